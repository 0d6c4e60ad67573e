//! The real program: what it refuses and how, and one small run from suite to figures.

#![allow(clippy::unwrap_used, reason = "tests want to stop at the first surprise")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of one test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("ik-bench-cli-{}-{test}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn write(&self, name: &str, text: &str) -> String {
        let path = self.0.join(name);
        fs::write(&path, text).unwrap();
        path.display().to_string()
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    /// Runs the program in this folder.
    fn run(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_ik-bench"))
            .args(arguments)
            .current_dir(&self.0)
            .output()
            .unwrap()
    }

    fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let (text, errors) = (
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr),
        );
        assert!(output.status.success(), "{arguments:?}: {errors}");
        assert!(errors.is_empty(), "no progress bar outside a terminal: {errors}");
        text.into_owned()
    }

    /// Expects exit code 2, one message with all `words`, nothing on stdout and nothing in the folder `out`.
    fn refuse(&self, arguments: &[&str], words: &[&str]) {
        let output = self.run(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(
            message.starts_with("error: ") && message.matches("error:").count() == 1,
            "{message}"
        );
        assert!(!message.contains("panicked"), "{message}");
        for word in words {
            assert!(
                message.contains(word),
                "{arguments:?}: `{word}` is missing in: {message}"
            );
        }
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert!(
            !Path::new(&self.path("out")).exists(),
            "{arguments:?} wrote something"
        );
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A leftover in the folder for temporary files harms nobody.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The squat, a twentieth of a second long.
fn short_squat() -> String {
    let text = include_str!("../suites/coman/squat.toml");
    text.replace("duration_s = 3.0", "duration_s = 0.05")
        .replace("coman/squat", "short/squat")
}

#[test]
fn unknown_names_are_refused() {
    let folder = Folder::new("names");
    let refuse = |arguments: &[&str], words: &[&str]| {
        folder.refuse(&[arguments, &["--out", "out"]].concat(), words);
    };
    refuse(
        &["run", "coman/squad"],
        &["suite `coman/squad`", "did you mean `coman/squat`?", "coman/lean"],
    );
    refuse(
        &["run", "closed-form/gird"],
        &["did you mean `closed-form/grid`?", "coman/lean"],
    );
    refuse(
        &["run", "closed-form"],
        &[
            "suite = closed-form",
            "this group: closed-form/grid, closed-form/continuity",
        ],
    );
    refuse(
        &["run", "coman/"],
        &["suite = coman/", "this group: coman/squat, coman/stretch"],
    );
    refuse(&["run", "nowhere.toml"], &["nowhere.toml", "cannot be read"]);
    refuse(
        &["run", "coman/squat", "--method", "ik44"],
        &["method `ik44`", "did you mean `ik4`?", "penalty-cg"],
    );
    refuse(
        &["run", "coman/squat", "--set", "gama=3"],
        &["parameter `gama`", "did you mean `gamma`?"],
    );
    refuse(
        &["run", "coman/squat", "--method", "ik1", "--set", "gamma=3"],
        &["parameter `gamma`", "damping"],
    );
    refuse(
        &["run", "coman/squat", "--set", "gamma"],
        &["--set = gamma", "KEY=VALUE"],
    );
    refuse(
        &["run", "coman/squat", "--set", "gamma=-1"],
        &["`gamma`", "-1", "allowed"],
    );
    refuse(
        &["run", "coman/squat", "--set", "gamma=nan"],
        &["`gamma`", "nan", "allowed"],
    );
    refuse(
        &["run", "coman/squat", "--set", "rows=most"],
        &["`rows`", "most", "literal"],
    );
    let robot = short_squat().replace("coman-legs", "coman-lex");
    let robot = folder.write("robot.toml", &robot);
    refuse(
        &["run", &robot],
        &["robot.toml", "robot `coman-lex`", "did you mean `coman-legs`?"],
    );
}

#[test]
fn numbers_that_cannot_be_are_refused() {
    let folder = Folder::new("numbers");
    for (dt, words) in [
        ("0", "dt_s = 0"),
        ("-0.005", "dt_s = -0.005"),
        ("nan", "dt_s = NaN"),
        ("1e-12", "dt_s = 0.00"),
    ] {
        let dt = format!("--dt={dt}");
        folder.refuse(&["run", "coman/squat", &dt, "--out", "out"], &[words, "allowed"]);
    }
    folder.refuse(
        &["run", "coman/squat", "--dt", "fast", "--out", "out"],
        &["--dt", "fast"],
    );
    folder.refuse(
        &["run", "coman/boundary", "--dt", "0.2", "--out", "out"],
        &["dt_s = 0.2", "0.125"],
    );
    folder.refuse(
        &["run", "coman/squat", "--margin", "3", "--out", "out"],
        &["margin = 3"],
    );
    folder.refuse(
        &["run", "coman/squat", "--velocity", "0", "--out", "out"],
        &["velocity = 0", "above 0"],
    );
    folder.refuse(
        &["run", "coman/squat", "--rates", "exact", "--out", "out"],
        &["exact", "analytic"],
    );
    let step = ["run", "coman/squat", "--out", "out", "--dump-step", "601"];
    folder.refuse(&step, &["--dump-step = 601", "1 .. 600"]);
    folder.refuse(&["run", "coman/squat", "--dump-step", "6"], &["--out"]);
}

#[test]
fn bad_suites_are_refused() {
    let folder = Folder::new("suites");
    let refuse = |from: &str, to: &str, words: &[&str]| {
        assert!(short_squat().contains(from), "{from}");
        let suite = folder.write("mine.toml", &short_squat().replacen(from, to, 1));
        folder.refuse(
            &["run", &suite, "--out", "out", "--trace"],
            &[&["mine.toml"], words].concat(),
        );
    };
    refuse("dt_s = 0.005", "dt_s = = 0.005", &["line"]);
    refuse(
        "dt_s = 0.005",
        "speed = 1\ndt_s = 0.005",
        &["line", "unknown field `speed`"],
    );
    refuse(
        "amplitude = 0.03",
        "amplitude = nan",
        &["motion[0].shape.bump.amplitude = NaN", "finite"],
    );
    refuse(
        "amplitude = 0.03",
        "amplitude = inf",
        &["motion[0].shape.bump.amplitude = inf", "finite"],
    );
    refuse(
        "joints.LKneeSag = 1.2",
        "joints.LKneeSag = -0.1",
        &["joints.LKneeSag = -0.1", "0 .. 1.9199"],
    );
    refuse(
        "uniform = 1.0",
        "diagonal = [1.0, 2.0]",
        &["com", "2 entries", "3 entries"],
    );
    let bad = "robot = { urdf-file = { path = 'bad.urdf', root = 'floating' } }";
    folder.write("bad.urdf", "<robot name='r'>\n<link name='a'>\n</robot>");
    refuse(
        "robot = { embedded = \"coman-legs\" }",
        bad,
        &["bad.urdf", "malformed XML"],
    );
    folder.write(
        "bad.urdf",
        "<robot name='r'>\n<link name='a'/>\n<link name='b'/>\n</robot>",
    );
    refuse(
        "robot = { embedded = \"coman-legs\" }",
        bad,
        &["bad.urdf", "no parent", "a, b"],
    );
}

#[test]
fn bad_instances_and_folders_are_refused() {
    let folder = Folder::new("instances");
    folder.refuse(&["solve", "none.json"], &["none.json", "cannot be read"]);
    let broken = folder.write("broken.json", "{\"schema\": \"ik-bench/instance/1\", ");
    folder.refuse(&["solve", &broken], &["broken.json", "line 1 column"]);
    let nan = folder.write("nan.json", "{\"schema\": NaN}");
    folder.refuse(
        &["solve", &nan],
        &["nan.json", "not a number at line 1 column 12"],
    );
    folder.refuse(&["figures", "nowhere"], &["nowhere"]);
    folder.refuse(&["readme", "nowhere", "README.md"], &["nowhere"]);
    folder.refuse(&["list", "animals"], &["animals", "methods"]);
    folder.refuse(&["--quick", "--bogus"], &["--bogus"]);
}

#[test]
fn lists_name_what_there_is() {
    let folder = Folder::new("lists");
    let methods = folder.succeed(&["list", "methods"]);
    for words in [
        "ik1:",
        "ik5:",
        "penalty-lbfgs:",
        "--set gamma=10.0",
        "a whole number from 1",
        "\"literal\"",
    ] {
        assert!(methods.contains(words), "`{words}` is missing in: {methods}");
    }
    let suites = folder.succeed(&["list", "suites"]);
    assert!(
        suites.contains("coman/asymmetric") && suites.contains("C8_2_3"),
        "{suites}"
    );
    assert!(suites.contains("closed-form/grid: "), "{suites}");
    assert!(folder.succeed(&["list", "robots"]).contains("coman-legs"));
}

#[test]
fn methods_are_explained() {
    let folder = Folder::new("explain");
    let svg = folder.path("graph.svg");
    let davies = folder.succeed(&["explain", "davies", "--robot", "bioloid", "--svg", &svg]);
    for words in [
        "links     45",
        "N         24 x 48, rank 24; mobility 24",
        "Ns        24 x 24, rank 24",
        "6 imposed, 0 compromised, on 6 joints: left-foot",
    ] {
        assert!(davies.contains(words), "{words} is missing in:\n{davies}");
    }
    assert!(fs::read_to_string(svg).unwrap().contains("circuit 4"));
    let limbs = folder.succeed(&["explain", "reverse-decoupling", "--robot", "hrp2"]);
    assert_eq!(
        limbs.matches("closed form: leg of the paper").count(),
        2,
        "{limbs}"
    );
    assert_eq!(limbs.matches("theta = q +90.000 deg").count(), 2, "{limbs}");
    assert_eq!(
        folder.succeed(&["explain", "closed-form", "--robot", "hrp2"]),
        limbs
    );
    let urdf = "<robot name='post'><link name='a'/><link name='b'/><joint name='turn' type='continuous'>\
                <parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint></robot>";
    folder.write("post.urdf", urdf);
    let post = folder.succeed(&["explain", "closed-form", "--robot", "post.urdf"]);
    assert!(
        post.contains("limbs of post") && post.contains("fewer than six joints"),
        "{post}"
    );
    folder.refuse(&["explain", "closed-form", "--robot", "no.urdf"], &["no.urdf"]);
    folder.refuse(
        &["explain", "closed-form", "--robot", "hubo", "--svg", "out.svg"],
        &["--svg = out.svg", "davies"],
    );
    folder.refuse(
        &["explain", "closed-form", "--suite", "closed-form/grid"],
        &["--suite = closed-form/grid", "--robot"],
    );
    folder.refuse(&["explain", "ik4", "--robot", "bioloid"], &["ik4", "davies"]);
    folder.refuse(&["explain", "davies", "--robot", "arm7"], &["arm7", "bioloid"]);
    folder.refuse(
        &["explain", "reverse-decoupling", "--robot", "hubbo"],
        &["hubbo", "did you mean `hubo`"],
    );
}

#[test]
fn a_limb_takes_a_pose_in_all_its_postures() {
    let folder = Folder::new("limb");
    let file = |frame: &str, z: f64, extra: &str| {
        format!(
            "{{\"schema\": \"ik-bench/limb-pose/1\", \"robot\": {{\"embedded\": \"hubo\"}}, \"frame\": \"{frame}\", \
             \"position_m\": [0.05, -0.1, {z}], \"rotation_xyzw\": [0.0, 0.0, 0.0, 1.0]{extra}}}"
        )
    };
    let bent = ", \"previous\": {\"r_leg_4\": 1.0}";
    let solve = |text: &str, options: &[&str]| -> serde_json::Value {
        let path = folder.write("pose.json", text);
        let arguments = [&["solve", &path][..], options].concat();
        serde_json::from_str(&folder.succeed(&arguments)).unwrap()
    };
    let all = solve(&file("r_sole", -0.7, bent), &["--all-solutions"]);
    let solutions = all["solutions"].as_array().unwrap();
    assert_eq!((all["outcome"].as_str(), solutions.len()), (Some("solved"), 8));
    for solution in solutions {
        assert!(solution["error_m"].as_f64().unwrap() < 1e-12);
        let knee = solution["joints"]["r_leg_4"].as_f64().unwrap();
        assert_eq!(solution["indicators"]["knee"].as_i64().unwrap() < 0, knee < 0.0);
    }
    let one = solve(&file("r_sole", -0.7, bent), &[]);
    assert_eq!(one["solutions"].as_array().unwrap().len(), 1);
    assert_eq!(one["solutions"][0], solutions[0]);
    let far = solve(&file("r_sole", -1.7, ""), &["--all-solutions"]);
    assert!(
        far["outcome"].as_str().unwrap().starts_with("out of reach"),
        "{far}"
    );
    assert!(far["solutions"].as_array().unwrap().is_empty());
    let path = folder.write("bad.json", &file("waist", -0.7, ""));
    folder.refuse(&["solve", &path], &["frame", "waist", "r_sole"]);
    let path = folder.write(
        "bad.json",
        &file("r_sole", -0.7, ", \"previous\": {\"l_leg_4\": 1.0}"),
    );
    folder.refuse(&["solve", &path], &["previous", "l_leg_4", "r_leg_4"]);
    let skewed = file("r_sole", -0.7, "").replace("[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.3, 0.0, 1.0]");
    let path = folder.write("bad.json", &skewed);
    folder.refuse(&["solve", &path], &["rotation_xyzw", "unit quaternion", "1e-6"]);
}

#[test]
fn a_file_to_solve_is_judged_by_the_schema_it_names() {
    let folder = Folder::new("schema");
    let good = "{\"schema\": \"ik-bench/limb-pose/1\",\n \"robot\": {\"embedded\": \"hubo\"}, \"frame\": \"r_sole\",\n \
                \"position_m\": [0.05, -0.1, -0.7],\n \"rotation_xyzw\": [0.0, 0.0, 0.0, 1.0],\n \
                \"previous\": {\"r_leg_4\": 1.0}}";
    folder.succeed(&["solve", &folder.write("good.json", good)]);
    let refuse = |from: &str, to: &str, words: &[&str]| {
        assert!(good.contains(from), "{from}");
        let path = folder.write("bad.json", &good.replacen(from, to, 1));
        folder.refuse(&["solve", &path], &[&["bad.json"], words].concat());
    };
    refuse("-0.1", "NaN", &["not a number at line 3 column"]);
    refuse("-0.1", "-Infinity", &["line 3 column"]);
    refuse("-0.1", "1e999", &["number out of range at line 3 column"]);
    refuse(
        "\"r_leg_4\": 1.0",
        "\"r_leg_4\": NaN",
        &["not a number at line 5"],
    );
    let both = "allowed: ik-bench/instance/1, ik-bench/limb-pose/1";
    refuse(
        "limb-pose/1",
        "limb-pose/2",
        &["schema = \"ik-bench/limb-pose/2\"", both],
    );
    refuse(
        "\"schema\": \"ik-bench/limb-pose/1\",",
        "",
        &["schema = missing", both],
    );
    refuse("\"frame\"", "\"fram\"", &["unknown field `fram`", "`frame`"]);
}

#[test]
fn suites_of_limbs_leave_rows_and_figures_and_are_kept() {
    let folder = Folder::new("limbs");
    let suite = include_str!("../suites/closed-form/reach.toml").replace("closed-form/reach", "mine/reach");
    folder.write("mine.toml", &suite.replace("robot = \"hubo\"", "robot = \"nao\""));
    folder.refuse(
        &["run", "mine.toml", "--out", "out"],
        &["mine.toml: study.reach.slices[0]", "nao/r_sole", "hubo/r_sole"],
    );
    for (from, to, words) in [
        ("study.reach", "stduy.reach", ["unknown field `stduy`", "`study`"]),
        ("robots = [", "robot = [", ["unknown field `robot`", "`robots`"]),
        ("robots = [", "limbs = [", ["unknown field `limbs`", "`robots`"]),
    ] {
        folder.write("typo.toml", &suite.replace(from, to));
        folder.refuse(&["run", "typo.toml", "--out", "out"], &words);
    }
    let head = suite.split("[study.reach]").next().unwrap();
    folder.write("head.toml", head);
    folder.refuse(&["run", "head.toml", "--out", "out"], &["missing field `study`"]);
    folder.refuse(
        &["run", "closed-form/reach", "--method", "ik1", "--out", "out"],
        &["closed-form/reach", "--method"],
    );
    let run = [
        "run",
        "closed-form/reach",
        "closed-form/continuity",
        "--quick",
        "--trace",
        "--out",
        "out",
    ];
    let shown = folder.succeed(&run);
    assert!(
        shown.contains("closed-form/reach") && !shown.contains("NO"),
        "{shown}"
    );
    let rows = fs::read_to_string(folder.0.join("out/limbs.jsonl")).unwrap();
    assert!(rows.lines().count() > 100 && !folder.0.join("out/runs.jsonl").exists());
    let drawn = folder.succeed(&["figures", "out"]);
    assert!(
        drawn.contains("closed_form_errors.svg not drawn: no rows of closed-form/grid"),
        "{drawn}"
    );
    for name in ["workspace", "continuity", "postures"] {
        let svg = fs::read_to_string(folder.0.join(format!("out/figures/closed_form_{name}.svg"))).unwrap();
        assert!(svg.contains("</svg>") && !svg.contains("NaN"), "{name}");
    }
    let workspace = fs::read_to_string(folder.path("out/figures/closed_form_workspace.svg")).unwrap();
    assert!(workspace.contains("7 or 8 solutions") && !workspace.contains("5 or 6 solutions"));
    // Quick rows are made again, in place of the old ones.
    folder.succeed(&run);
    let again = fs::read_to_string(folder.0.join("out/limbs.jsonl")).unwrap();
    assert_eq!(again, rows);
}

#[test]
fn without_a_folder_a_run_shows_its_table_and_writes_nothing() {
    let folder = Folder::new("table");
    let suite = folder.write("short.toml", &short_squat());
    let text = folder.succeed(&["run", &suite, "--method", "ik1,ik5", "--set", "n=4", "--quick"]);
    assert!(text.contains("short/squat") && text.contains("ik5"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    assert_eq!(
        fs::read_dir(&folder.0).unwrap().count(),
        1,
        "only the suite is there"
    );
}

#[test]
fn a_run_leaves_rows_traces_and_steps_that_replay() {
    let folder = Folder::new("run");
    let suite = folder.write("short.toml", &short_squat());
    let run = [
        "run",
        &suite,
        "--method",
        "ik1",
        "--method",
        "ik4",
        "--out",
        "out",
        "--trace",
        "--dump-step",
        "7",
    ];
    folder.succeed(&run);
    let rows = rows(&folder);
    assert_eq!(rows.len(), 4, "ik1, and ik4 with n = 15, n = 3 and literal rows");
    for row in &rows {
        assert_eq!(row["suite"], "short/squat");
        assert!(row["metrics"]["com_error_rms_m"].as_f64().unwrap() < 1e-3);
        assert!(row["metrics"]["step_ratio_to_ik1"].as_f64().unwrap() > 0.0);
        let trace = fs::read_to_string(folder.0.join("out").join(row["trace"].as_str().unwrap())).unwrap();
        assert_eq!(trace.lines().count(), 12, "a header and samples 0 .. 10");
        replay(&folder, row, &trace);
    }
    folder.succeed(&["figures", "out"]);
    let readme = folder.write(
        "README.md",
        "a\n<!-- results:begin -->\nold\n<!-- results:end -->\nb\n",
    );
    folder.succeed(&["readme", "out", &readme]);
    let text = fs::read_to_string(&readme).unwrap();
    assert!(
        text.contains("| method |") && !text.contains("old") && text.ends_with("b\n"),
        "{text}"
    );
    folder.succeed(&["run", &suite, "--method", "ik1", "--out", "out", "--fresh"]);
    assert_eq!(self::rows(&folder).len(), 1, "--fresh starts over");
}

fn rows(folder: &Folder) -> Vec<serde_json::Value> {
    let text = fs::read_to_string(folder.0.join("out/runs.jsonl")).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

/// Solves the dumped step 7 of a row's run and compares its q with line 7 of the trace, digit by digit.
fn replay(folder: &Folder, row: &serde_json::Value, trace: &str) {
    let stem = row["trace"]
        .as_str()
        .unwrap()
        .trim_start_matches("traces/")
        .trim_end_matches(".csv");
    let instance = format!("out/instances/{stem}_step-7.json");
    let answer: serde_json::Value = serde_json::from_str(&folder.succeed(&["solve", &instance])).unwrap();
    let found: Vec<f64> = answer["q"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect();
    let line = trace.lines().nth(8).unwrap();
    let expected: Vec<f64> = line
        .split(',')
        .skip(1)
        .take(19)
        .map(|v| v.parse().unwrap())
        .collect();
    let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&found), bits(&expected), "{stem}");
    let other: serde_json::Value =
        serde_json::from_str(&folder.succeed(&["solve", &instance, "--method", "ik5"])).unwrap();
    assert_eq!(other["method"], "ik5");
    let refused = folder.run(&["solve", &instance, "--method", "ik4", "--set", "n=0.5"]);
    let message = String::from_utf8_lossy(&refused.stderr);
    assert!(
        refused.status.code() == Some(2) && message.contains("`n`") && message.contains("0.5"),
        "{message}"
    );
}
