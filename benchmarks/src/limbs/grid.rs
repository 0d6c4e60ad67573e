//! Poses of given joints, solved and judged: the test of the source's section V.

use super::numbers::Numbers;
use super::record::{GridFindings, Times};
use super::subject::{Answers, Joints, SNAPPED, Solve, Subject, away, distinct};
use super::suite::{GridCounts, GridSpec};
use nalgebra::Isometry3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;

/// Where generating joints come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Set {
    /// Multiples of a step (degrees).
    OnAxis(f64),
    /// Multiples of a step behind an offset (degrees).
    OffAxis(f64, f64),
    /// Uniform over a turn.
    Random,
}

impl Set {
    pub(super) fn all(spec: &GridSpec) -> Vec<Self> {
        let on = spec.on_axis_deg.iter().map(|step| Self::OnAxis(*step));
        let off = Self::OffAxis(spec.off_axis.step_deg, spec.off_axis.offset_deg);
        on.chain([off, Self::Random]).collect()
    }

    pub(super) fn id(self) -> String {
        match self {
            Self::OnAxis(step) => format!("on-axis-{step}"),
            Self::OffAxis(step, offset) => format!("off-axis-{step}+{offset}"),
            Self::Random => "random".to_owned(),
        }
    }

    /// Step and first value (degrees) of a grid.
    fn grid(self) -> Option<(f64, f64)> {
        match self {
            Self::OnAxis(step) => Some((step, 0.0)),
            Self::OffAxis(step, offset) => Some((step, offset)),
            Self::Random => None,
        }
    }

    /// Where the solver starts, and what is asked: on the axes, where most postures are singular, it is given the generating
    /// joints and has to return them; elsewhere it is given nothing.
    fn demands(self) -> Demands {
        match self {
            Self::OnAxis(_) => Demands {
                given: Given::Generating,
                error: SNAPPED,
                recovered_within_rad: 1e-5,
            },
            Self::OffAxis(..) | Self::Random => Demands {
                given: Given::Zeros,
                error: 1e-10,
                recovered_within_rad: 1e-6,
            },
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Given {
    /// Previous joints are the generating ones, and every pose is compared.
    Generating,
    /// Previous joints are zeros, and regular poses are compared.
    Zeros,
}

#[derive(Clone, Copy, Debug)]
struct Demands {
    given: Given,
    /// Largest error of a pose (m and rad).
    error: f64,
    recovered_within_rad: f64,
}

/// Generating joints of a set, and how many points the whole grid has.
#[derive(Clone, Debug)]
pub(super) struct Postures {
    pub(super) joints: Vec<Joints>,
    pub(super) grid_points: Option<f64>,
}

/// Draws or enumerates the generating joints: D-H angles for a grid, so that it is on the axes of the source.
pub(super) fn postures(subject: &Subject, set: Set, counts: &GridCounts, mut numbers: Numbers) -> Postures {
    let count = subject.joints();
    let Some((step, offset)) = set.grid() else {
        let mut draw = |_| std::array::from_fn(|i| if i < count { numbers.angle() } else { 0.0 });
        return Postures {
            joints: (0..counts.random).map(&mut draw).collect(),
            grid_points: None,
        };
    };
    let values = (360.0 / step).round() as usize;
    let points = (values as f64).powi(count as i32);
    let at = |digits: &mut dyn FnMut() -> usize| {
        let mut angles = [0.0; 6];
        angles[..count]
            .iter_mut()
            .for_each(|angle| *angle = (offset + step * digits() as f64).to_radians());
        subject.joints_at(&angles)
    };
    let joints = if points <= counts.whole_up_to as f64 {
        let whole = |mut index: usize| {
            at(&mut || {
                let digit = index % values;
                index /= values;
                digit
            })
        };
        (0..points as usize).map(whole).collect()
    } else {
        (0..counts.sampled)
            .map(|_| at(&mut || numbers.below(values)))
            .collect()
    };
    Postures {
        joints,
        grid_points: Some(points),
    }
}

/// Poses judged at once; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 512;

/// Solves the pose of every posture and judges what comes back; times are left at zero.
pub(super) fn judge(subject: &Subject, set: Set, postures: &Postures, solve: &Solve<'_>) -> GridFindings {
    let demands = set.demands();
    let chunks = postures.joints.par_chunks(CHUNK);
    let tallies: Vec<GridFindings> = chunks
        .map(|chunk| judge_chunk(subject, demands, chunk, solve))
        .collect();
    let mut found = tallies.into_iter().fold(GridFindings::default(), merged);
    found.grid_points = postures.grid_points;
    found.recovered_within_rad = demands.recovered_within_rad;
    if subject.indicated(&[0.0; 6]).is_none() {
        found.indicated = None;
    }
    found.held = held(&found, demands, subject.solutions());
    found
}

/// Every pose solved, every solution meets it, and every compared pose gives its joints back, in the indicated branch and
/// among the full number of `solutions`.
fn held(found: &GridFindings, demands: Demands, solutions: Option<u32>) -> bool {
    // Next to a double root branches merge, and rounding decides which is indicated: on the axes both are only reported.
    let branches = match demands.given {
        Given::Generating => true,
        Given::Zeros => {
            found.indicated.is_none_or(|right| right == found.compared)
                && (solutions.is_none() || found.compared == 0 || found.distinct_compared_min == solutions)
        }
    };
    // Where nothing was compared, nothing has been shown.
    found.compared > 0
        && found.unsolved == 0
        && found.not_finite == 0
        && found.error_max_m < demands.error
        && found.error_max_rad < demands.error
        && found.recovered == found.compared
        && branches
}

fn judge_chunk(subject: &Subject, demands: Demands, chunk: &[Joints], solve: &Solve<'_>) -> GridFindings {
    let mut kinematics = subject.kinematics();
    let mut answers = Answers::new();
    let mut tally = GridFindings {
        indicated: Some(0),
        ..GridFindings::default()
    };
    for joints in chunk {
        let pose = kinematics.tip(joints);
        let previous = match demands.given {
            Given::Generating => *joints,
            Given::Zeros => [0.0; 6],
        };
        tally.poses += 1;
        if solve(&pose, &previous, &mut answers).is_err() || answers.is_empty() {
            answers.clear();
            tally.unsolved += 1;
        }
        let all = answers.len();
        answers.retain(|(q, _)| q.iter().all(|q| q.is_finite()));
        tally.not_finite += (all - answers.len()) as u64;
        tally.solutions += all as u64;
        for (solution, _) in &answers {
            let (metres, radians) = kinematics.error(&pose, solution);
            tally.error_max_m = tally.error_max_m.max(metres);
            tally.error_max_rad = tally.error_max_rad.max(radians);
            *tally
                .error_decades
                .entry(decade(metres.max(radians)))
                .or_default() += 1;
        }
        let different = distinct(&answers);
        *tally.distinct.entry(different).or_default() += 1;
        if demands.given == Given::Zeros && !subject.is_regular(joints) {
            tally.excluded += 1;
            continue;
        }
        compare(subject, demands, joints, &answers, &mut tally);
        let least = tally
            .distinct_compared_min
            .map_or(different, |least| least.min(different));
        tally.distinct_compared_min = Some(least);
    }
    tally
}

/// Looks for the generating joints among the answers.
fn compare(
    subject: &Subject,
    demands: Demands,
    joints: &Joints,
    answers: &[(Joints, u8)],
    tally: &mut GridFindings,
) {
    tally.compared += 1;
    let nearest = answers.iter().map(|(q, _)| away(q, joints)).reduce(f64::min);
    if let Some(nearest) = nearest {
        tally.away_max_rad = tally.away_max_rad.max(nearest);
        tally.recovered += u64::from(nearest <= demands.recovered_within_rad);
    }
    let indicated = subject.indicated(joints);
    let right = |(q, branch): &(Joints, u8)| {
        Some(*branch) == indicated && away(q, joints) <= demands.recovered_within_rad
    };
    if let Some(count) = &mut tally.indicated {
        *count += u64::from(answers.iter().any(right));
    }
}

/// Lowest decade of an error that is told apart.
const LEAST_DECADE: i32 = -18;

fn decade(error: f64) -> i32 {
    if error > 0.0 {
        (error.log10().floor() as i32).max(LEAST_DECADE)
    } else {
        LEAST_DECADE
    }
}

fn merged(mut all: GridFindings, one: GridFindings) -> GridFindings {
    fn add<K: Ord>(into: &mut BTreeMap<K, u64>, from: BTreeMap<K, u64>) {
        for (key, count) in from {
            *into.entry(key).or_default() += count;
        }
    }
    all.poses += one.poses;
    all.unsolved += one.unsolved;
    all.solutions += one.solutions;
    all.not_finite += one.not_finite;
    all.error_max_m = all.error_max_m.max(one.error_max_m);
    all.error_max_rad = all.error_max_rad.max(one.error_max_rad);
    add(&mut all.error_decades, one.error_decades);
    all.compared += one.compared;
    all.excluded += one.excluded;
    all.recovered += one.recovered;
    all.away_max_rad = all.away_max_rad.max(one.away_max_rad);
    all.indicated = Some(all.indicated.unwrap_or(0) + one.indicated.unwrap_or(0));
    add(&mut all.distinct, one.distinct);
    let leasts = [all.distinct_compared_min, one.distinct_compared_min];
    all.distinct_compared_min = leasts.into_iter().flatten().min();
    all
}

/// Repeats of a timing, of which the least counts.
const REPEATS: usize = 5;

/// Times the solver and one tree pass on some of the postures, serially.
pub(super) fn times(subject: &Subject, postures: &Postures, timed: usize) -> Times {
    let mut kinematics = subject.kinematics();
    let joints: Vec<Joints> = postures.joints.iter().copied().take(timed).collect();
    let poses: Vec<Isometry3<f64>> = joints.iter().map(|q| kinematics.tip(q)).collect();
    let mut answers = Answers::new();
    let solve_ns = least_ns(poses.len(), || {
        for pose in &poses {
            // A pose that is refused is counted where it is judged.
            let _ = black_box(subject.solve(black_box(pose), &[0.0; 6], &mut answers));
        }
    });
    let forward_ns = least_ns(joints.len(), || {
        for q in &joints {
            kinematics.pass(black_box(q));
            black_box(&kinematics);
        }
    });
    Times {
        solve_ns,
        forward_ns,
        ratio: solve_ns / forward_ns.max(f64::MIN_POSITIVE),
    }
}

/// Least time of one of `count` things done together (ns).
fn least_ns(count: usize, mut work: impl FnMut()) -> f64 {
    let one = |_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64() * 1e9 / count.max(1) as f64
    };
    (0..REPEATS).map(one).fold(f64::MAX, f64::min)
}

/// Numbers that define a set.
pub(super) fn parameters(set: Set, counts: &GridCounts) -> BTreeMap<String, serde_json::Value> {
    let mut parameters: BTreeMap<String, serde_json::Value> = BTreeMap::new();
    if let Some((step, offset)) = set.grid() {
        parameters.insert("step_deg".to_owned(), step.into());
        parameters.insert("offset_deg".to_owned(), offset.into());
        parameters.insert("whole_up_to".to_owned(), counts.whole_up_to.into());
        parameters.insert("sampled".to_owned(), counts.sampled.into());
    } else {
        parameters.insert("random".to_owned(), counts.random.into());
    }
    parameters
}
