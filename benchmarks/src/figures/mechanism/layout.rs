//! Where the links of a mechanism stand: the tree of bodies from the top down, one column per limb and per virtual chain,
//! the ground below all of them.

use ik_methods::davies::{LinkKind, Mechanism};

/// A chain from the ground to a link.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// Its joints, from the ground on.
    pub(super) joints: Vec<usize>,
    /// The link at its end.
    pub(super) end: usize,
    /// Its column.
    pub(super) column: f64,
    /// The circuit it closes, counted from 1; none for the chain of the root.
    pub(super) circuit: Option<usize>,
}

/// Columns and levels; both count from 0.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Column and level of each link; those of virtual links and of the ground stay at the origin.
    pub(super) links: Vec<(f64, f64)>,
    pub(super) chains: Vec<Chain>,
    /// Column where a root that no chain moves stands on the ground.
    pub(super) fixture: Option<f64>,
    pub(super) columns: usize,
    /// Levels of bodies.
    pub(super) levels: usize,
    /// Most joints of a chain.
    pub(super) longest: usize,
}

impl Layout {
    pub(super) fn new(mechanism: &Mechanism) -> Self {
        let chains = chains(mechanism);
        let mut layout = Self {
            links: vec![(0.0, 0.0); mechanism.links.len()],
            longest: chains.iter().map(|c| c.joints.len()).max().unwrap_or_default(),
            chains,
            fixture: None,
            columns: 0,
            levels: 1,
        };
        layout.place(mechanism, ROOT, 0);
        // The centre of mass belongs to no body: it stands beside them all.
        for link in 0..mechanism.links.len() {
            if mechanism.links[link].kind == LinkKind::CentreOfMass {
                layout.place(mechanism, link, 0);
            }
        }
        layout
    }

    /// Gives columns to a link, what hangs on it and its chains; the chains of a link stand between its limbs.
    fn place(&mut self, mechanism: &Mechanism, link: usize, level: usize) {
        self.levels = self.levels.max(level + 1);
        let children: Vec<usize> = children(mechanism, link);
        let (before, after) = children.split_at(children.len() / 2);
        let mut columns = Vec::new();
        for &child in before {
            self.place(mechanism, child, level + 1);
            columns.push(self.links[child].0);
        }
        if link == ROOT && self.chains.iter().all(|c| c.circuit.is_some()) {
            let column = self.next_column();
            self.fixture = Some(column);
            columns.push(column);
        }
        for chain in 0..self.chains.len() {
            if self.chains[chain].end == link {
                self.chains[chain].column = self.next_column();
                columns.push(self.chains[chain].column);
            }
        }
        for &child in after {
            self.place(mechanism, child, level + 1);
            columns.push(self.links[child].0);
        }
        if columns.is_empty() {
            columns.push(self.next_column());
        }
        let middle = (columns[0] + columns[columns.len() - 1]) / 2.0;
        self.links[link] = (middle, level as f64);
    }

    fn next_column(&mut self) -> f64 {
        self.columns += 1;
        (self.columns - 1) as f64
    }
}

/// The ground is link 0, the root body comes next.
pub(super) const ROOT: usize = 1;

/// Bodies that real joints move against this one.
fn children(mechanism: &Mechanism, link: usize) -> Vec<usize> {
    let real = mechanism
        .joints
        .iter()
        .filter(|j| j.chain.is_none() && j.from == link);
    real.map(|j| j.to).collect()
}

/// Virtual chains that begin at the ground: each goes on from link to link until it meets one that is not its own.
fn chains(mechanism: &Mechanism) -> Vec<Chain> {
    let mut chains: Vec<Chain> = Vec::new();
    for (index, joint) in mechanism
        .joints
        .iter()
        .enumerate()
        .filter(|(_, j)| j.chain.is_some())
    {
        if joint.from == 0 {
            let circuit = mechanism
                .circuits
                .iter()
                .position(|c| Some(&c.task) == joint.chain.as_ref());
            chains.push(Chain {
                joints: vec![index],
                end: joint.to,
                column: 0.0,
                circuit: circuit.map(|c| c + 1),
            });
        } else if let Some(chain) = chains
            .iter_mut()
            .find(|c| c.end == joint.from && is_virtual(mechanism, joint.from))
        {
            chain.joints.push(index);
            chain.end = joint.to;
        }
    }
    chains
}

fn is_virtual(mechanism: &Mechanism, link: usize) -> bool {
    mechanism.links[link].kind == LinkKind::Virtual
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::{Case, Suite, Variation};
    use ik_core::problem::PhaseId;

    fn layout(suite: &str) -> (Mechanism, Layout) {
        let suite = Suite::load(suite).unwrap();
        let case = Case::new(&suite, 0, &Variation::default()).unwrap();
        let mechanism = Mechanism::new(&case.problem, PhaseId(0));
        let layout = Layout::new(&mechanism);
        (mechanism, layout)
    }

    #[test]
    fn every_virtual_joint_is_in_one_chain_and_no_two_links_stand_in_one_place() {
        for suite in ["bioloid/gait", "bioloid/com-sway", "coman/squat"] {
            let (mechanism, layout) = layout(suite);
            let mut joints: Vec<usize> = layout.chains.iter().flat_map(|c| c.joints.clone()).collect();
            joints.sort_unstable();
            let chained = |i: &usize| mechanism.joints[*i].chain.is_some();
            let expected: Vec<usize> = (0..mechanism.joints.len()).filter(chained).collect();
            // A posture has no chain from the ground; none of these suites imposes one.
            assert_eq!(joints, expected, "{suite}");
            let solid: Vec<usize> = (1..mechanism.links.len())
                .filter(|&l| !is_virtual(&mechanism, l))
                .collect();
            for &a in &solid {
                let there = solid.iter().filter(|&&b| layout.links[b] == layout.links[a]);
                assert_eq!(there.count(), 1, "{suite}: {}", mechanism.links[a].name);
            }
        }
    }

    #[test]
    fn the_gait_has_five_columns_and_the_chain_of_the_waist_in_the_middle() {
        let (mechanism, layout) = layout("bioloid/gait");
        assert_eq!((layout.columns, layout.levels, layout.longest), (5, 7, 6));
        let waist = layout.chains.iter().find(|c| c.circuit.is_none()).unwrap();
        assert_eq!(mechanism.links[waist.end].name, "waist");
        assert_eq!(waist.column.to_bits(), 2.0_f64.to_bits());
        let closing: Vec<Option<usize>> = layout
            .chains
            .iter()
            .filter(|c| c.circuit.is_some())
            .map(|c| c.circuit)
            .collect();
        assert_eq!(closing, [Some(1), Some(2), Some(3), Some(4)]);
    }
}
