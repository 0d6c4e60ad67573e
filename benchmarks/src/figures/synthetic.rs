//! Made-up rows and traces of the shape a full run has, for the tests of figures and tables.

use crate::machine::machine;
use crate::records::{Effort, Machine, Metrics, Quality, Row, SCHEMA, TerminationRecord, Trace};
use crate::records_io::{ROWS_FILE, RowStore, write_trace};
use crate::runner::{Session, Timing, run_case};
use crate::suite::{Case, Selection, Suite, Variation, lineup};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// (method, n, literal, floor of the error in m, lag in s, base step time in µs)
type Recipe = (&'static str, Option<u64>, bool, f64, f64, f64);
const RECIPES: [Recipe; 13] = [
    ("ik1", None, false, 1.5e-3, 0.30, 5.0),
    ("ik2", Some(15), false, 1.9e-5, 0.10, 60.0),
    ("ik2", Some(3), false, 4.0e-4, 0.22, 13.0),
    ("ik3", None, false, 1.5e-3, 0.32, 9.0),
    ("ik4", Some(15), false, 4.9e-5, 0.02, 31.0),
    ("ik4", Some(3), false, 5.1e-5, 0.02, 14.0),
    ("ik4", Some(15), true, 4.8e-5, 0.02, 33.0),
    ("ik4", Some(3), true, 5.0e-5, 0.02, 15.0),
    ("ik5", Some(15), false, 4.9e-5, 0.03, 29.0),
    ("ik5", Some(3), false, 5.2e-5, 0.04, 14.5),
    ("penalty-cg", Some(15), false, 2.0e-3, 0.10, 400.0),
    ("penalty-lbfgs", Some(15), false, 8.0e-4, 0.10, 300.0),
    ("a-later-one", None, false, 3.0e-4, 0.05, 3.0),
];

/// A new empty folder for one test.
pub(crate) fn folder(name: &str) -> PathBuf {
    let dir = std::env::temp_dir().join(format!("ik-bench-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).unwrap();
    dir
}

/// A row with plausible numbers and no trace.
pub(crate) fn row(method: &str, n: Option<u64>, suite: &str, scenario: &str) -> Row {
    let mut parameters = BTreeMap::from([
        ("rows".to_owned(), "soft".into()),
        ("gamma".to_owned(), 10.0.into()),
    ]);
    parameters.extend(n.map(|n| ("n".to_owned(), n.into())));
    Row {
        schema: SCHEMA.to_owned(),
        method: method.to_owned(),
        parameters,
        suite: suite.to_owned(),
        scenario: scenario.to_owned(),
        dt_s: 0.005,
        seed: 0,
        revision: "0123abc".to_owned(),
        machine: Machine {
            cpu: "made-up".to_owned(),
            cores: 2,
            system: "linux x86_64".to_owned(),
        },
        termination: TerminationRecord::Completed {
            steps: BTreeMap::from([("converged".to_owned(), 600)]),
        },
        notes: Vec::new(),
        metrics: Some(Metrics {
            quality: quality(),
            effort: effort(),
        }),
        trace: None,
    }
}

fn quality() -> Quality {
    Quality {
        com_error_rms_m: Some(1.5e-3),
        com_error_max_m: Some(2.2e-3),
        soft_error_rms: BTreeMap::from([("com".to_owned(), 1.5e-3)]),
        hard_error_max_m: 1.0 / 3.0 * 1e-9,
        hard_error_max_rad: 1e-17,
        com_rate_error_rms_m_s: Some(0.02),
        boundary_value_max: Some(-1.2e-12),
        velocity_max_rad_s: 3.93,
        velocity_ratio_max: 0.98,
        acceleration_max_rad_s2: 53.0,
        sigma_min: 1e-9,
        hard_rank_min: 15,
        survived: true,
        ..Quality::default()
    }
}

fn effort() -> Effort {
    Effort {
        majors_mean: 3.0,
        majors_max: 4,
        step_us_median: 5.2,
        step_ratio_to_ik1: Some(1.0),
        ..Effort::default()
    }
}

/// Writes a results folder with all Coman suites.
pub(crate) fn write_results(dir: &Path) {
    let mut scenarios: Vec<(String, String)> = [
        ("squat", "A"),
        ("stretch", "B"),
        ("stretch", "B1"),
        ("asymmetric", "C"),
        ("lean", "D"),
        ("lean", "D2"),
    ]
    .map(|(s, c)| (format!("coman/{s}"), c.to_owned()))
    .to_vec();
    for family in 0..12 {
        let (height, roll, period) = (6 + family % 3, 1 + family / 3 % 2, 4 - family / 6);
        scenarios.push((
            "coman/asymmetric".to_owned(),
            format!("C{height}_{roll}_{period}"),
        ));
    }
    for knee in ["stretched", "0.2", "0.4", "0.6", "0.8", "1.0", "1.2", "1.4"] {
        scenarios.push(("coman/posture".to_owned(), knee.to_owned()));
    }
    let mut store = RowStore::open(dir).unwrap();
    for (suite, scenario) in &scenarios {
        for recipe in RECIPES {
            store.push(made_up(dir, recipe, suite, scenario, 10.0)).unwrap();
        }
    }
    for (recipe, gamma) in [(RECIPES[4], 10.0), (RECIPES[8], 10.0)] {
        for scenario in ["ellipse", "polygon"] {
            store
                .push(made_up(dir, recipe, "coman/boundary", scenario, gamma))
                .unwrap();
        }
        for gamma in [0.0, 1.0, 3.0, 10.0, 30.0, 100.0] {
            store
                .push(made_up(dir, recipe, "coman/regulator", "B", gamma))
                .unwrap();
        }
    }
    assert!(dir.join(ROWS_FILE).exists());
}

fn made_up(dir: &Path, recipe: Recipe, suite: &str, scenario: &str, gamma: f64) -> Row {
    let (method, n, literal, floor, lag, us) = recipe;
    let mut row = row(method, n, suite, scenario);
    row.parameters.insert("gamma".to_owned(), gamma.into());
    if literal {
        row.parameters.insert("rows".to_owned(), "literal".into());
    }
    if method == "penalty-cg" && suite == "coman/lean" {
        row.termination = TerminationRecord::Declined {
            reason: "made up".to_owned(),
        };
        row.metrics = None;
        return row;
    }
    let polygon = if scenario == "polygon" { 0.25 } else { 0.0 };
    let trace = trace(suite, scenario, floor, lag + polygon + 0.05 / (1.0 + gamma), us);
    let name = format!(
        "traces/{}-{scenario}-{method}-{}-{literal}-{gamma}.csv",
        suite.replace('/', "-"),
        n.unwrap_or(0)
    );
    write_trace(&dir.join(&name), &trace).unwrap();
    let error: Vec<f64> = trace.column("com_error_m").unwrap();
    let rms = (error.iter().map(|e| e * e).sum::<f64>() / error.len() as f64).sqrt();
    let start_knee = trace.column("LKneeSag").unwrap()[0];
    let metrics = row.metrics.as_mut().unwrap();
    metrics.quality.com_error_rms_m = Some(rms);
    metrics.quality.com_error_max_m = error.into_iter().reduce(f64::max);
    metrics.quality.survived = !(suite == "coman/asymmetric" && (lag > 0.09 || scenario.ends_with("_3")));
    metrics.quality.singularity_exit_s = Some(3.34 + lag + polygon + 0.05 / (1.0 + gamma));
    metrics.quality.acceleration_max_rad_s2 = 33.0 + 370.0 / (1.0 + gamma);
    metrics.quality.torque_squared_mean_n2m2 = Some(40.0 + 250.0 * start_knee * start_knee + 1e4 * floor);
    metrics.effort.majors_mean = n.map_or(1.0, |n| n.min(4) as f64);
    metrics.effort.step_us_median = us;
    metrics.effort.step_ratio_to_ik1 = Some(us / 5.0);
    row.trace = Some(name);
    row
}

fn trace(suite: &str, scenario: &str, floor: f64, lag: f64, us: f64) -> Trace {
    let columns = [
        "t",
        "com_x",
        "com_y",
        "com_z",
        "com_target_x",
        "com_target_y",
        "com_target_z",
        "com_error_m",
        "com_rate_error_m_s",
        "LKneeSag",
        "RKneeSag",
        "LHipSag",
        "step_us",
        "majors",
        "minors",
        "torque_LKneeSag",
    ]
    .map(str::to_owned)
    .to_vec();
    let (height, period, end, reach) = match suite {
        "coman/squat" => (0.03, 1.0, 3.0, 0.55),
        "coman/stretch" if scenario == "B1" => (0.08, 1.0, 3.0, 0.548),
        "coman/posture" => (0.0, 1.0, 2.0, 0.55),
        _ => (0.08, 2.0, 4.0, 0.548),
    };
    let start = match scenario {
        "stretched" => 0.15,
        _ => scenario.parse().unwrap_or(1.2),
    };
    let bump = |t: f64| 0.4887 + height * (1.0 - (TAU * t / period).cos()) / 2.0;
    let mut rows = Vec::new();
    let mut knee_before = start;
    for k in 0..=(end / 0.005) as usize {
        let t = k as f64 * 0.005;
        let target = bump(t);
        // Out of reach, and for the lag after it, the leg is straight.
        let stuck = target > reach || (bump(t - lag) > reach && t > lag);
        let ripple = floor * (TAU * 2.0 * t / period).sin() * f64::from(u8::from(k > 0));
        let z = if stuck { reach } else { target + ripple };
        let knee = if height > 0.0 {
            start * ((reach - z).max(0.0) / (reach - 0.4887)).sqrt()
        } else {
            start
        };
        let spread = 1.0 + 0.3 * (t * 70.0).sin().abs() + if k % 97 == 3 { 9.0 } else { 0.0 };
        rows.push(vec![
            t,
            0.02,
            0.0,
            z,
            0.02,
            0.0,
            target,
            (z - target).abs(),
            floor * 30.0 * (t * 9.0).cos().abs(),
            knee,
            knee * (1.0 - 0.2 * (t * 3.0).sin()),
            -0.5 + 1.2 * (t * 0.8).sin() + floor * 100.0,
            if k == 0 { 0.0 } else { us * spread },
            3.0,
            5.0,
            -0.5 - 12.0 * knee + 30.0 * (knee - knee_before),
        ]);
        knee_before = knee;
    }
    Trace { columns, rows }
}

/// Runs methods on scenarios of an embedded suite at a time step (s), rows and traces into a folder.
pub(crate) fn run_into(
    dir: &Path,
    (id, scenarios): (&str, &[&str]),
    (methods, dt_s): (&[&str], f64),
    set: &str,
) {
    let suite = Suite::load(id).unwrap();
    let selection = Selection {
        methods: methods.iter().map(|id| (*id).to_owned()).collect(),
        set: toml::from_str(set).unwrap(),
    };
    let contestants = lineup(&suite, &selection).unwrap();
    let session = Session {
        revision: "0123abc".to_owned(),
        machine: machine(),
        timing: Timing::QUICK,
        notes: Vec::new(),
    };
    let variation = Variation {
        dt_s: Some(dt_s),
        ..Variation::default()
    };
    let mut store = RowStore::open(dir).unwrap();
    for (index, scenario) in suite.scenarios.iter().enumerate() {
        if !scenarios.contains(&scenario.id.as_str()) {
            continue;
        }
        let case = Case::new(&suite, index, &variation).unwrap();
        let finished = run_case(&case, &contestants, &session, &|_| {});
        for (i, finished) in finished.into_iter().enumerate() {
            let name = format!("traces/{}-{}-{i}.csv", suite.id.replace('/', "-"), scenario.id);
            let trace = finished.trace(&case).unwrap();
            write_trace(&dir.join(&name), &trace).unwrap();
            let row = Row {
                trace: Some(name),
                ..finished.row
            };
            store.push(row).unwrap();
        }
    }
}
