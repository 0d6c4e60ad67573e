//! The closed mechanism as a graph: links are its vertices, joints its edges, and every task closes one circuit
//! ground – root chain – real joints – task chain – ground (Tsai 2001; the Bioloid paper, Fig. 5).
//!
//! Joints stand in the order of the columns of the network matrix: root chain, real joints, task chains.

use super::circuits::{Circuits, Group};
use ik_core::problem::{PhaseId, Problem};
use ik_core::robot::{Robot, Root};
use ik_core::task::{Priority, Track};

/// Where a coordinate stands in `N_s q̇_s = −N_p q̇_p`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Primary: imposed by a hard task.
    Imposed,
    /// Primary: imposed by a compromised task, as far as the hard ones allow.
    Compromised,
    /// Secondary: an unknown.
    Secondary,
}

impl Role {
    /// Whether its rate is given.
    pub fn is_primary(self) -> bool {
        self != Self::Secondary
    }
}

/// What a link is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkKind {
    /// The ground.
    Ground,
    /// A body of the robot.
    Body,
    /// A massless link of a virtual chain.
    Virtual,
    /// The centre of mass, which is no link: its circuit is the mean of those to all of them.
    CentreOfMass,
}

/// A vertex.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MechanismLink {
    /// Name: of the body, or `V <chain> <number>`.
    pub name: String,
    /// What it is.
    pub kind: LinkKind,
}

/// An edge.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MechanismJoint {
    /// Name: of the joint, or `<chain> px` … `<chain> rz`.
    pub name: String,
    /// Index of the link it starts from.
    pub from: usize,
    /// Index of the link it moves.
    pub to: usize,
    /// Chain it belongs to; none for a real joint.
    pub chain: Option<String>,
    /// Role of its coordinate.
    pub role: Role,
}

/// A circuit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MechanismCircuit {
    /// Task that closes it.
    pub task: String,
    /// Joints and the sense in which the circuit passes them, +1 or −1.
    pub joints: Vec<(usize, i8)>,
    /// Rows it contributes: 6, 3 for a centre of mass, 1 for a joint of a posture.
    pub rows: usize,
}

/// Links, joints and circuits of one phase of a problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mechanism {
    /// Vertices; 0 is the ground, then the bodies.
    pub links: Vec<MechanismLink>,
    /// Edges, in the order of columns.
    pub joints: Vec<MechanismJoint>,
    /// Real joints that follow the coordinate of another (mimic): edges without a column of their own.
    pub followers: Vec<MechanismJoint>,
    /// Circuits, in the order of rows.
    pub circuits: Vec<MechanismCircuit>,
    /// Task whose chain is the root's, if one is.
    pub imposed_root: Option<usize>,
    /// Blocks of N_s: circuits that share no unknown with others.
    pub blocks: Vec<MechanismBlock>,
}

/// Circuits that are solved together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MechanismBlock {
    /// Their tasks.
    pub tasks: Vec<String>,
    /// Indices of the real joints among their unknowns.
    pub joints: Vec<usize>,
    /// Whether the root is among them.
    pub free_root: bool,
    /// Coordinates that hard tasks impose on them.
    pub imposed: usize,
    /// Coordinates that compromised tasks impose.
    pub compromised: usize,
}

const CHAIN: [&str; 6] = ["px", "py", "pz", "rx", "ry", "rz"];

impl Mechanism {
    /// The mechanism of a phase.
    pub fn new(problem: &Problem, phase: PhaseId) -> Self {
        let robot = problem.robot();
        let phase = &problem.phases()[phase.0];
        let circuits = Circuits::new(problem, phase);
        let imposed_root = circuits.imposed_root;
        let mut mechanism = Self {
            links: vec![MechanismLink {
                name: "ground".to_owned(),
                kind: LinkKind::Ground,
            }],
            joints: Vec::new(),
            followers: Vec::new(),
            circuits: Vec::new(),
            imposed_root,
            blocks: circuits
                .groups
                .iter()
                .map(|group| block(problem, group))
                .collect(),
        };
        for body in robot.bodies() {
            mechanism.link(&body.name, LinkKind::Body);
        }
        if robot.root() == Root::Floating {
            let (name, role) = match imposed_root {
                Some(task) => (problem.tasks()[task].name.as_str(), Role::Imposed),
                None => ("root", Role::Secondary),
            };
            mechanism.chain(name, body_link(0), &CHAIN.map(|axis| (axis, role)));
        }
        mechanism.real_joints(robot);
        for (task, priority) in phase.tasks.iter().filter(|(task, _)| Some(*task) != imposed_root) {
            mechanism.close(problem, *task, priority);
        }
        mechanism
    }

    /// Freedom of the mechanism: joints less the rows of the circuits, which are always independent since each has a
    /// chain of its own.
    pub fn mobility(&self) -> usize {
        self.joints.len() - self.rows()
    }

    /// Rows of the network matrix.
    pub fn rows(&self) -> usize {
        self.circuits.iter().map(|c| c.rows).sum()
    }

    /// Indices of the joints whose rates are given, or of the others.
    pub fn columns(&self, primary: Role) -> Vec<usize> {
        let wanted = primary.is_primary();
        (0..self.joints.len())
            .filter(|&j| self.joints[j].role.is_primary() == wanted)
            .collect()
    }

    fn link(&mut self, name: &str, kind: LinkKind) -> usize {
        self.links.push(MechanismLink {
            name: name.to_owned(),
            kind,
        });
        self.links.len() - 1
    }

    /// Adds a virtual chain from the ground to link `to`; returns its joints.
    fn chain(&mut self, name: &str, to: usize, axes: &[(&str, Role)]) -> Vec<usize> {
        let (mut from, mut joints) = (0, Vec::new());
        for (i, (axis, role)) in axes.iter().enumerate() {
            let next = if i + 1 == axes.len() {
                to
            } else {
                self.link(&format!("V {name} {}", i + 1), LinkKind::Virtual)
            };
            joints.push(self.joints.len());
            self.joints.push(MechanismJoint {
                name: format!("{name} {axis}"),
                from,
                to: next,
                chain: Some(name.to_owned()),
                role: *role,
            });
            from = next;
        }
        joints
    }

    /// One edge per real joint; the first of each coordinate has its column.
    fn real_joints(&mut self, robot: &Robot) {
        for coordinate in 0..robot.coordinates().len() {
            let joints = robot.joints().iter().enumerate();
            let mut edges = joints
                .filter(|(_, joint)| joint.coordinate == coordinate)
                .map(|(i, joint)| MechanismJoint {
                    name: joint.name.clone(),
                    from: body_link(joint.parent),
                    to: body_link(i + 1),
                    chain: None,
                    role: Role::Secondary,
                });
            self.joints.extend(edges.next());
            self.followers.extend(edges);
        }
    }

    fn close(&mut self, problem: &Problem, task: usize, priority: &Priority) {
        let robot = problem.robot();
        let name = &problem.tasks()[task].name;
        let imposed = match priority {
            Priority::Hard => Role::Imposed,
            Priority::Compromised(_) => Role::Compromised,
        };
        let chain = |linear: Role, angular: Role| {
            let role = |i: usize| if i < 3 { linear } else { angular };
            std::array::from_fn::<_, 6, _>(|i| (CHAIN[i], role(i)))
        };
        let monitored = Role::Secondary;
        let (frame, axes) = match problem.tasks()[task].track {
            Track::Pose(f) => (f, chain(imposed, imposed)),
            Track::Position(f) => (f, chain(imposed, monitored)),
            Track::Orientation(f) => (f, chain(monitored, imposed)),
            Track::CentreOfMass => return self.close_mass(robot, name, imposed),
            Track::Posture => return self.close_posture(robot, name, imposed),
        };
        let body = robot.frames()[frame.0].body;
        let mut path: Vec<usize> = robot
            .path(body)
            .iter()
            .map(|&i| robot.joints()[i].coordinate)
            .collect();
        path.sort_unstable();
        path.dedup();
        let virtual_joints = self.chain(name, body_link(body), &axes);
        self.circuit(robot, name, &path, &virtual_joints, 6);
    }

    fn close_mass(&mut self, robot: &Robot, name: &str, imposed: Role) {
        let mean = self.link("centre of mass", LinkKind::CentreOfMass);
        let virtual_joints = self.chain(name, mean, &CHAIN.map(|axis| (axis, imposed))[..3]);
        let all: Vec<usize> = (0..robot.coordinates().len()).collect();
        self.circuit(robot, name, &all, &virtual_joints, 3);
    }

    fn close_posture(&mut self, robot: &Robot, name: &str, imposed: Role) {
        let root = robot.root().nv();
        for coordinate in 0..robot.coordinates().len() {
            let beside = self.joints[root + coordinate].clone();
            let joint = self.joints.len();
            self.joints.push(MechanismJoint {
                name: format!("{name} {}", beside.name),
                chain: Some(name.to_owned()),
                role: imposed,
                ..beside
            });
            self.circuits.push(MechanismCircuit {
                task: name.to_owned(),
                joints: vec![(root + coordinate, 1), (joint, -1)],
                rows: 1,
            });
        }
    }

    /// Adds the circuit root chain, real joints (by coordinate), task chain reversed.
    fn circuit(&mut self, robot: &Robot, task: &str, path: &[usize], chain: &[usize], rows: usize) {
        let root = robot.root().nv();
        let forward = (0..root).chain(path.iter().map(|c| root + c)).map(|j| (j, 1));
        let back = chain.iter().rev().map(|&j| (j, -1));
        self.circuits.push(MechanismCircuit {
            task: task.to_owned(),
            joints: forward.chain(back).collect(),
            rows,
        });
    }
}

fn block(problem: &Problem, group: &Group) -> MechanismBlock {
    let root = problem.robot().root().nv();
    let all = || group.hard.iter().chain(&group.soft);
    let mut tasks: Vec<String> = all().map(|c| problem.tasks()[c.task].name.clone()).collect();
    tasks.dedup();
    MechanismBlock {
        tasks,
        joints: group.joints.iter().map(|joint| root + joint).collect(),
        free_root: group.root.is_unknown(),
        imposed: group.hard.iter().map(|c| c.rows).sum(),
        compromised: group.soft.iter().map(|c| c.rows).sum(),
    }
}

/// Link of a body: the ground comes first.
fn body_link(body: usize) -> usize {
    body + 1
}
