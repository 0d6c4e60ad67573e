//! The circuits of one phase, sorted into groups that share no unknown, and their solution.
//!
//! Circuits are coupled by shared joints only, and by the root if it is free: with an imposed root and one task per limb
//! the secondary matrix falls into one block per limb, which are solved one by one.

use super::rows::Closing;
use super::virtual_chain::Instant;
use crate::least_norm::{DEPENDENT, DROP, DROP_AT_GENERIC_POSTURE, MOST_FREE, Ranks, Stage, fade};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::{Phase, Problem};
use ik_core::robot::Root;
use ik_core::spatial::screw::Screw;
use ik_core::task::{Priority, Track};
use ik_core::weights::WeightFactor;

/// Part of a task that closes one circuit: the task itself, or one joint of a posture.
#[derive(Clone, Debug)]
pub(super) struct Circuit {
    pub(super) task: usize,
    /// Joint coordinate of a posture's circuit.
    pub(super) joint: Option<usize>,
    /// Rows that are imposed.
    pub(super) rows: usize,
    /// Factor of the weights of a compromised task, for these rows.
    pub(super) weights: Option<WeightFactor>,
}

/// Circuits that share unknowns.
#[derive(Clone, Debug)]
pub(super) struct Group {
    pub(super) hard: Vec<Circuit>,
    pub(super) soft: Vec<Circuit>,
    /// Joint coordinates of the group, ascending.
    pub(super) joints: Vec<usize>,
    /// Whether the root is among the unknowns.
    pub(super) root: RootChain,
    /// Hard rows, compromised rows.
    stages: [Stage; 2],
    soft_rows: Vec<f64>,
    x: Vec<f64>,
    /// Least λ of the hard rows in the later evaluations of a step.
    floor: f64,
}

/// What the chain from the ground to the root does for a group of circuits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RootChain {
    /// Its rates are known: imposed, or the root is fixed.
    Known,
    /// Its six coordinates are unknown and cost nothing: the circuits determine them.
    Free,
    /// Its six coordinates are unknown, and the circuits leave some of them open: all cost what joint rates do, m/s and
    /// rad/s alike.
    Costed,
}

/// All circuits of one phase.
#[derive(Clone, Debug)]
pub(super) struct Circuits {
    /// The hard pose task of a frame on the root link, if any: its chain is the root's.
    pub(super) imposed_root: Option<usize>,
    pub(super) groups: Vec<Group>,
    /// Place of each joint coordinate within its group.
    place: Vec<usize>,
}

/// How the rates came out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quality {
    /// Whether hard rows were damped, or compromised ones are dependent.
    pub(super) damped: bool,
    /// Sum of squares that hard rows miss.
    pub(super) missed_squared: f64,
}

/// λ of the two priorities. Those that fade in towards a singularity are in parts of the longest row, which makes them
/// independent of units and weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Damping {
    /// λ of hard rows everywhere (m, rad).
    pub(super) hard: f64,
    /// λ of hard rows at a singularity.
    pub(super) singular: f64,
    /// λ of compromised rows at a singularity.
    pub(super) soft: f64,
    /// Independence from which compromised rows are not damped.
    pub(super) soft_threshold: f64,
}

/// What hard tasks impose on one group.
#[derive(Clone, Debug)]
pub(super) struct Imposed {
    pub(super) rows: usize,
    pub(super) rank: usize,
    /// What compromised tasks can still have of what is left.
    pub(super) compromised: usize,
    pub(super) mobility: usize,
    pub(super) tasks: Vec<usize>,
}

impl Circuits {
    pub(super) fn new(problem: &Problem, phase: &Phase) -> Self {
        let robot = problem.robot();
        let imposed_root = imposed_root(problem, phase);
        let mut pieces: Vec<Piece> = phase
            .tasks
            .iter()
            .filter(|(task, _)| Some(*task) != imposed_root)
            .flat_map(|(task, priority)| pieces(problem, *task, priority, imposed_root))
            .collect();
        let mut groups = Vec::new();
        let mut place = vec![0; robot.coordinates().len()];
        while let Some(first) = pieces.pop() {
            let mut members = vec![first];
            let mut next = 0;
            while next < members.len() {
                let (shared, apart) = pieces.into_iter().partition(|p| p.touches(&members[next]));
                pieces = apart;
                members.extend::<Vec<_>>(shared);
                next += 1;
            }
            groups.push(Group::new(members, &mut place));
        }
        groups.reverse();
        Self {
            imposed_root,
            groups,
            place,
        }
    }

    /// Counts ranks at the given postures (length nq each), caps the factorisations by them, and lets a root that the
    /// circuits leave open cost its length. Until then ranks are whatever is found.
    pub(super) fn count_ranks(&mut self, problem: &Problem, postures: &[Vec<f64>]) {
        let found = self.ranks_at(problem, postures);
        for (group, [hard, soft]) in self.groups.iter_mut().zip(found) {
            if group.root == RootChain::Free && hard.free + soft.free < MOST_FREE {
                *group = group.with_costed_root();
            }
        }
        let found = self.ranks_at(problem, postures);
        for (group, ranks) in self.groups.iter_mut().zip(found) {
            for (stage, ranks) in group.stages.iter_mut().zip(ranks) {
                stage.cap(ranks);
            }
        }
    }

    /// The largest ranks of both stages of every group.
    fn ranks_at(&mut self, problem: &Problem, postures: &[Vec<f64>]) -> Vec<[Ranks; 2]> {
        let mut ranks = vec![[Ranks::NONE; 2]; self.groups.len()];
        let mut page = Page::new(problem.robot());
        for q in postures {
            forward(problem.robot(), q, &mut page);
            let resting = vec![0.0; 2 * (problem.nx() + problem.nxdot())];
            let instant = Instant::resting(problem, &resting);
            let at = Closing {
                problem,
                q,
                page: &page,
                instant: &instant,
            };
            for (group, most) in self.groups.iter_mut().zip(&mut ranks) {
                group.factorise(&at, &Screw::default(), &self.place, DROP_AT_GENERIC_POSTURE);
                group.stages[0].decide(0.0);
                group.follow(&at, &Screw::default(), &self.place, DROP_AT_GENERIC_POSTURE);
                for (most, stage) in most.iter_mut().zip(&group.stages) {
                    *most = most.max(stage.found());
                }
            }
        }
        ranks
    }

    /// What hard tasks impose on each group, after [`Circuits::count_ranks`].
    pub(super) fn imposed(&self) -> Vec<Imposed> {
        let imposed = |group: &Group| {
            let mut tasks: Vec<usize> = group.hard.iter().map(|c| c.task).collect();
            tasks.dedup();
            let [rank, compromised] = [0, 1].map(|k| group.stages[k].most()).map(|r| r.free + r.costed);
            Imposed {
                rows: group.hard.iter().map(|c| c.rows).sum(),
                rank,
                compromised,
                mobility: group.unknowns(),
                tasks,
            }
        };
        self.groups.iter().map(imposed).collect()
    }

    /// Writes the velocity (length nv, world axes) that closes all circuits while the primary joints move as imposed.
    pub(super) fn solve(
        &mut self,
        problem: &Problem,
        q: &[f64],
        page: &Page,
        instant: &Instant<'_>,
        damping: Damping,
        v: &mut [f64],
    ) -> Quality {
        v.fill(0.0);
        let at = Closing {
            problem,
            q,
            page,
            instant,
        };
        if let Some(rate) = at.secondary_rate() {
            // Also of joints that no circuit touches.
            let joints = v[problem.robot().root().nv()..].iter_mut();
            joints.enumerate().for_each(|(j, v)| *v = rate(j));
        }
        let root = self.imposed_root.map_or_else(Screw::default, |task| {
            let twist = at.root_twist(task);
            v[..3].copy_from_slice(twist.linear.as_slice());
            v[3..6].copy_from_slice(twist.angular.as_slice());
            twist
        });
        let mut quality = Quality::default();
        for group in &mut self.groups {
            let found = group.solve(&at, &root, &self.place, damping, v);
            quality.damped |= found.damped;
            quality.missed_squared += found.missed_squared;
        }
        quality
    }
}

/// The hard pose task of a frame on the root link, in a phase.
fn imposed_root(problem: &Problem, phase: &Phase) -> Option<usize> {
    let robot = problem.robot();
    let on_root = |task: usize| match problem.tasks()[task].track {
        Track::Pose(f) => robot.frames()[f.0].body == 0,
        _ => false,
    };
    let mut hard = phase.tasks.iter().filter(|(_, p)| *p == Priority::Hard);
    hard.find(|(task, _)| robot.root() == Root::Floating && on_root(*task))
        .map(|(task, _)| *task)
}

/// A circuit with what it touches, before circuits are grouped.
struct Piece {
    circuit: Circuit,
    hard: bool,
    joints: Vec<usize>,
    root: RootChain,
}

impl Piece {
    fn touches(&self, other: &Self) -> bool {
        let both_free = self.root == RootChain::Free && other.root == RootChain::Free;
        both_free || self.joints.iter().any(|j| other.joints.contains(j))
    }
}

fn pieces(problem: &Problem, task: usize, priority: &Priority, imposed_root: Option<usize>) -> Vec<Piece> {
    let robot = problem.robot();
    let track = problem.tasks()[task].track;
    let rows = track.rows(robot);
    let weights = match priority {
        Priority::Hard => None,
        Priority::Compromised(weights) => WeightFactor::new(weights, rows),
    };
    let hard = *priority == Priority::Hard;
    let all: Vec<usize> = (0..robot.coordinates().len()).collect();
    let on_path = |body: usize| {
        let mut joints: Vec<usize> = robot
            .path(body)
            .iter()
            .map(|&i| robot.joints()[i].coordinate)
            .collect();
        joints.sort_unstable();
        joints.dedup();
        joints
    };
    let root = match robot.root() {
        Root::Floating if imposed_root.is_none() => RootChain::Free,
        _ => RootChain::Known,
    };
    let whole = |joints: Vec<usize>, weights: Option<WeightFactor>| Piece {
        circuit: Circuit {
            task,
            joint: None,
            rows,
            weights,
        },
        hard,
        joints,
        root,
    };
    match track {
        Track::Position(f) | Track::Orientation(f) | Track::Pose(f) => {
            vec![whole(on_path(robot.frames()[f.0].body), weights)]
        }
        Track::CentreOfMass => vec![whole(all, weights)],
        Track::Posture => posture_pieces(task, hard, rows, weights),
    }
}

/// One circuit per joint, or one for all if a weight matrix couples them.
fn posture_pieces(task: usize, hard: bool, rows: usize, weights: Option<WeightFactor>) -> Vec<Piece> {
    let one = |j: usize, weights| Piece {
        circuit: Circuit {
            task,
            joint: Some(j),
            rows: 1,
            weights,
        },
        hard,
        joints: vec![j],
        root: RootChain::Known,
    };
    match weights {
        None => (0..rows).map(|j| one(j, None)).collect(),
        Some(WeightFactor::Diagonal(d)) => {
            let scaled = |j: usize| one(j, Some(WeightFactor::Diagonal(vec![d[j]])));
            (0..rows).map(scaled).collect()
        }
        Some(upper) => vec![Piece {
            circuit: Circuit {
                task,
                joint: None,
                rows,
                weights: Some(upper),
            },
            hard,
            joints: (0..rows).collect(),
            root: RootChain::Known,
        }],
    }
}

impl Group {
    fn new(mut members: Vec<Piece>, place: &mut [usize]) -> Self {
        members.sort_by_key(|piece| (piece.circuit.task, piece.circuit.joint));
        let mut joints: Vec<usize> = members.iter().flat_map(|piece| piece.joints.clone()).collect();
        joints.sort_unstable();
        joints.dedup();
        for (local, &joint) in joints.iter().enumerate() {
            place[joint] = local;
        }
        let free = members.iter().any(|piece| piece.root == RootChain::Free);
        let root = if free { RootChain::Free } else { RootChain::Known };
        let (hard, soft): (Vec<_>, Vec<_>) = members.into_iter().partition(|piece| piece.hard);
        let circuits = |pieces: Vec<Piece>| pieces.into_iter().map(|p| p.circuit).collect();
        Self::of(circuits(hard), circuits(soft), joints, root)
    }

    fn of(hard: Vec<Circuit>, soft: Vec<Circuit>, joints: Vec<usize>, root: RootChain) -> Self {
        let height = |circuits: &[Circuit]| circuits.iter().map(|c| c.rows).sum::<usize>();
        let (free, costed) = root.split(joints.len());
        let stage = |circuits: &[Circuit]| Stage::new(height(circuits), free, costed);
        Self {
            stages: [stage(&hard), stage(&soft)],
            soft_rows: vec![0.0; height(&soft) * (free + costed + 1)],
            x: vec![0.0; costed],
            floor: 0.0,
            hard,
            soft,
            joints,
            root,
        }
    }

    fn with_costed_root(&self) -> Self {
        let (hard, soft) = (self.hard.clone(), self.soft.clone());
        Self::of(hard, soft, self.joints.clone(), RootChain::Costed)
    }

    /// Root coordinates and joints among the unknowns.
    fn unknowns(&self) -> usize {
        let (free, costed) = self.root.split(self.joints.len());
        free + costed
    }

    /// Fills and factorises the hard rows.
    fn factorise(&mut self, at: &Closing<'_>, root: &Screw, place: &[usize], drop: f64) {
        let (free, costed) = self.root.split(self.joints.len());
        let rows = self.stages[0].clear(free, costed);
        at.fill(&self.hard, self.root, root, place, rows);
        at.lean(&self.joints, free + costed + 1, rows);
        self.stages[0].factorise(drop);
    }

    /// Fills and factorises the compromised rows in what the decided hard ones leave.
    fn follow(&mut self, at: &Closing<'_>, root: &Screw, place: &[usize], drop: f64) {
        self.soft_rows.fill(0.0);
        at.fill(&self.soft, self.root, root, place, &mut self.soft_rows);
        at.lean(&self.joints, self.unknowns() + 1, &mut self.soft_rows);
        let [hard, soft] = &mut self.stages;
        hard.follow(&mut self.soft_rows, soft);
        soft.factorise_followed(drop);
    }

    /// Rates of the group's joints (and root): hard circuits first, the compromised ones in what those leave.
    fn solve(
        &mut self,
        at: &Closing<'_>,
        root: &Screw,
        place: &[usize],
        damping: Damping,
        v: &mut [f64],
    ) -> Quality {
        self.factorise(at, root, place, DROP);
        let (lambda, mut damped) = self.hard_damping(at, damping);
        let missed = self.stages[0].decide(lambda);
        let mut u = [0.0; MOST_FREE];
        self.x.fill(0.0);
        if !self.stages[1].is_empty() {
            self.follow(at, root, place, DROP);
            let [hard, soft] = &mut self.stages;
            let independence = soft.independence();
            damped |= independence < DEPENDENT;
            soft.decide(damping.soft * fade(independence, damping.soft_threshold) * soft.row_scale());
            let (free, costed) = hard.left();
            soft.finish(&mut u[..free], &mut self.x[..costed]);
        }
        let (free, _) = self.root.split(self.joints.len());
        self.stages[0].finish(&mut u[..free], &mut self.x);
        let joints = match self.root {
            RootChain::Known => &self.x[..],
            RootChain::Free => {
                v[..6].copy_from_slice(&u);
                &self.x[..]
            }
            RootChain::Costed => {
                v[..6].copy_from_slice(&self.x[..6]);
                &self.x[6..]
            }
        };
        let first = at.problem.robot().root().nv();
        for (&joint, rate) in self.joints.iter().zip(joints) {
            v[first + joint] = *rate;
        }
        if let Some(rate) = at.secondary_rate() {
            self.joints
                .iter()
                .for_each(|&joint| v[first + joint] += rate(joint));
        }
        Quality {
            damped,
            missed_squared: missed * missed,
        }
    }

    /// λ of the hard rows, and whether it is any. What the first evaluation of a step needs, the others keep: a limb that
    /// damping has just moved off a singularity would else be thrown by the next one.
    fn hard_damping(&mut self, at: &Closing<'_>, damping: Damping) -> (f64, bool) {
        let hard = &mut self.stages[0];
        let faded = fade(hard.independence(), DEPENDENT);
        let singular = damping.singular * faded * hard.row_scale();
        let kept = if at.instant.tau > 0.0 { self.floor } else { 0.0 };
        self.floor = singular.max(kept);
        let lambda = damping.hard.max(self.floor);
        (lambda, lambda > 0.0 && !hard.is_empty())
    }
}

impl RootChain {
    /// Free and costed unknowns of a group of `joints` joints. Rows are `[root | joints | imposed]` in either case.
    fn split(self, joints: usize) -> (usize, usize) {
        match self {
            Self::Known => (0, joints),
            Self::Free => (6, joints),
            Self::Costed => (0, 6 + joints),
        }
    }

    /// Whether the root is among the unknowns.
    pub(super) fn is_unknown(self) -> bool {
        self != Self::Known
    }
}
