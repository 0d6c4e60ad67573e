//! The graph of a closed mechanism: links are nodes, real joints solid arrows, virtual joints dashed ones, coloured by the
//! role of their coordinate (Tsai 2001; Fig. 5 of the paper that applies Davies' method to a Bioloid).

mod layout;

use super::FigureError;
use super::figure::{LEGEND_LINE, LINE_HEIGHT, MARGIN, TITLE_SIZE, lay_out_legend, wrapped};
use super::panel::TICK_SIZE;
use super::sheet::{Anchor, Drawing, Key, Point, Sheet, Shows, Stroke, Type, WIDTH, draw, text_width};
use super::style::{BLACK, BLUE, Dash, GREY, Marker, ORANGE, PALE, Style, VERMILLION, WHITE};
use ik_methods::davies::{LinkKind, Mechanism, MechanismCircuit, MechanismJoint, Role};
use layout::{Chain, Layout, ROOT};
use plotters::style::RGBColor;

/// The graph of a mechanism as SVG.
///
/// # Errors
/// [`FigureError::Draw`] if the drawing library refuses.
pub fn mechanism_svg(mechanism: &Mechanism, title: &str) -> Result<String, FigureError> {
    paint(mechanism, title).map_err(|reason| FigureError::Draw {
        figure: title.to_owned(),
        reason,
    })
}

/// Heights of a level of bodies and of a joint of a chain, and half that of a node.
const LEVEL: f64 = 58.0;
const CHAIN_STEP: f64 = 30.0;
const NODE_HALF: f64 = 9.0;
/// How far below its parent the arrow to a body becomes upright.
const BEND: f64 = 24.0;
/// Where the arrow of a posture's joint is, seen from that of the real one.
const BESIDE: f64 = -7.0;
/// Radius of a virtual link.
const VIRTUAL: f64 = 3.2;
/// Room below the ground for the names of the circuits.
const FEET: f64 = 58.0;
const TEXT: f64 = 11.0;
/// Least size of a text that is made to fit.
const LEAST_TEXT: f64 = 6.0;

pub(super) fn paint(mechanism: &Mechanism, title: &str) -> Result<String, String> {
    let layout = Layout::new(mechanism);
    let legend = lay_out_legend(&legend(mechanism));
    let legend_height = legend.last().map_or(0.0, |l| l.0.1) + LEGEND_LINE;
    let remarks: Vec<String> = remarks(mechanism, &layout)
        .iter()
        .flat_map(|r| wrapped(r))
        .collect();
    let head = MARGIN + LINE_HEIGHT + 6.0;
    let top = head + legend_height + 12.0;
    let ground = top + LEVEL * layout.levels as f64 + CHAIN_STEP * layout.longest as f64;
    let height = ground + FEET + 16.0 * remarks.len() as f64 + MARGIN;
    draw(height.ceil(), |sheet| {
        let title_at = (MARGIN, MARGIN + LINE_HEIGHT / 2.0);
        sheet.text(title, title_at, left(TITLE_SIZE, BLACK))?;
        for ((x, y), key) in &legend {
            sheet.key((*x, head + y + LEGEND_LINE / 2.0), key)?;
        }
        let painter = Graph {
            sheet,
            mechanism,
            layout: &layout,
            top,
            ground,
        };
        painter.paint()?;
        for (i, remark) in remarks.iter().enumerate() {
            let at = (MARGIN, ground + FEET + 8.0 + 16.0 * i as f64);
            sheet.text(remark, at, left(TICK_SIZE, GREY))?;
        }
        Ok(())
    })
}

fn left(size: f64, colour: RGBColor) -> Type {
    Type {
        size,
        anchor: Anchor::Left,
        colour,
    }
}

fn colour(role: Role) -> (&'static str, RGBColor) {
    match role {
        Role::Imposed => ("primary, imposed", VERMILLION),
        Role::Compromised => ("primary, compromised", ORANGE),
        Role::Secondary => ("secondary", BLUE),
    }
}

/// Virtual joints of different roles differ in dash, too.
fn dash(joint: &MechanismJoint) -> Dash {
    match (&joint.chain, joint.role) {
        (None, _) => Dash::Solid,
        (Some(_), Role::Imposed) => Dash::Long,
        (Some(_), Role::Compromised) => Dash::Short,
        (Some(_), Role::Secondary) => Dash::Dotted,
    }
}

/// One entry per kind of joint that occurs.
fn legend(mechanism: &Mechanism) -> Vec<Key> {
    let mut keys: Vec<Key> = Vec::new();
    for joint in &mechanism.joints {
        let (role, colour) = colour(joint.role);
        let name = match (&joint.chain, joint.role) {
            (None, _) => "real joint: secondary".to_owned(),
            (Some(_), Role::Secondary) => "virtual joint: secondary (monitored)".to_owned(),
            (Some(_), _) => format!("virtual joint: {role}"),
        };
        if keys.iter().all(|k| k.name != name) {
            let style = Style {
                colour,
                dash: dash(joint),
                marker: Marker::Circle,
            };
            keys.push(Key {
                name,
                style,
                shows: Shows::Line,
            });
        }
    }
    keys.push(Key {
        name: "virtual link".to_owned(),
        style: VIRTUAL_LINK,
        shows: Shows::Marker,
    });
    keys
}

const VIRTUAL_LINK: Style = Style {
    colour: GREY,
    dash: Dash::Solid,
    marker: Marker::Ring,
};

fn remarks(mechanism: &Mechanism, layout: &Layout) -> Vec<String> {
    let count = |role: Role| mechanism.joints.iter().filter(|j| j.role == role).count();
    let (imposed, compromised, secondary) = (
        count(Role::Imposed),
        count(Role::Compromised),
        count(Role::Secondary),
    );
    let real = mechanism.joints.iter().filter(|j| j.chain.is_none()).count();
    let root = match layout.fixture {
        Some(_) => "the fixed root",
        None => "the chain of the root",
    };
    let mut remarks = vec![
        format!(
            "{} links with the ground, {} joints ({real} real), {} circuits. N is {} × {}, mobility {}. Primary {} ({imposed} \
             imposed, {compromised} compromised), secondary {secondary}.",
            mechanism.links.len(),
            mechanism.joints.len(),
            mechanism.circuits.len(),
            mechanism.rows(),
            mechanism.joints.len(),
            mechanism.mobility(),
            imposed + compromised,
        ),
        format!(
            "A circuit goes from the ground through {root} and real joints to the link of its task, and back through the \
             chain of the task. Joints of a chain: translations px, py, pz, then rotations rx, ry, rz."
        ),
    ];
    if mechanism.links.iter().any(|l| l.kind == LinkKind::CentreOfMass) {
        remarks.push(
            "The circuit of the centre of mass is the mean, by mass, of circuits to all bodies.".to_owned(),
        );
    }
    remarks
}

struct Graph<'a, 'b> {
    sheet: &'a Sheet<'b>,
    mechanism: &'a Mechanism,
    layout: &'a Layout,
    top: f64,
    ground: f64,
}

impl Graph<'_, '_> {
    fn paint(&self) -> Drawing {
        self.ground()?;
        for joint in self.mechanism.joints.iter().filter(|j| j.chain.is_none()) {
            self.real_joint(joint)?;
        }
        for chain in &self.layout.chains {
            self.chain(chain)?;
        }
        self.beside_real_joints()?;
        for (link, node) in self.mechanism.links.iter().enumerate().skip(1) {
            if node.kind != LinkKind::Virtual {
                self.node(link)?;
            }
        }
        Ok(())
    }

    fn column_width(&self) -> f64 {
        (WIDTH - 2.0 * MARGIN) / self.layout.columns as f64
    }

    fn x(&self, column: f64) -> f64 {
        MARGIN + self.column_width() * (column + 0.5)
    }

    fn at(&self, link: usize) -> Point {
        let (column, level) = self.layout.links[link];
        (self.x(column), self.top + LEVEL * level + NODE_HALF)
    }

    /// The ground, and what holds a root that no chain moves.
    fn ground(&self) -> Drawing {
        let (low, high) = ((MARGIN, self.ground + 7.0), (WIDTH - MARGIN, self.ground));
        self.sheet.fill(low, high, GREY)?;
        if let Some(column) = self.layout.fixture {
            let (root, x) = (self.at(ROOT), self.x(column));
            let stroke = Stroke {
                colour: GREY,
                width: 5.0,
                dash: Dash::Solid,
            };
            let post = [root, (x, root.1 + LEVEL / 2.0), (x, self.ground)];
            self.sheet.line(&post, stroke)?;
            let look = self.look("fixed", 60.0, Anchor::Centre, BLACK);
            self.sheet.text("fixed", (x, self.ground + 17.0), look)?;
        }
        let look = self.look("ground", 60.0, Anchor::Left, BLACK);
        self.sheet.text("ground", (MARGIN, self.ground - 8.0), look)
    }

    fn real_joint(&self, joint: &MechanismJoint) -> Drawing {
        let to = self.at(joint.to);
        self.arrow(&self.way_down(joint, 0.0), joint)?;
        let at = (to.0 + 7.0, to.1 - NODE_HALF - 14.0);
        let look = self.look(&joint.name, self.column_width() * 0.9 - 8.0, Anchor::Left, GREY);
        self.sheet.text(&joint.name, at, look)
    }

    /// From a body to its child, `aside` to the right of its column and as much above. Slanted first, so that arrows to
    /// columns farther out pass above the names of the others.
    fn way_down(&self, joint: &MechanismJoint, aside: f64) -> [Point; 3] {
        let (from, to) = (self.at(joint.from), self.at(joint.to));
        let x = to.0 + aside;
        [
            (from.0 + aside, from.1 - aside),
            (x, from.1 - aside + BEND),
            (x, to.1 - NODE_HALF),
        ]
    }

    /// The chain from its link down to the ground, with its virtual links at equal distances above it.
    fn chain(&self, chain: &Chain) -> Drawing {
        let x = self.x(chain.column);
        let step = |i: usize| self.ground - CHAIN_STEP * i as f64;
        let end = self.at(chain.end);
        for (i, &index) in chain.joints.iter().enumerate() {
            let joint = &self.mechanism.joints[index];
            let next = if i + 1 == chain.joints.len() {
                let bend = end.1 + LEVEL - NODE_HALF;
                let mut path = vec![(x, step(i))];
                if (x - end.0).abs() > 1.0 {
                    path.push((x, bend.min(step(i) - 10.0)));
                }
                path.push((end.0, end.1 + NODE_HALF));
                path
            } else {
                vec![(x, step(i)), (x, step(i + 1) + VIRTUAL)]
            };
            self.arrow(&next, joint)?;
            let axis = joint.name.rsplit(' ').next().unwrap_or_default();
            let look = self.look(axis, 30.0, Anchor::Left, BLACK);
            self.sheet
                .text(axis, (x + 8.0, step(i) - CHAIN_STEP / 2.0), look)?;
        }
        for i in 1..chain.joints.len() {
            self.sheet
                .marker((x, step(i)), VIRTUAL, VIRTUAL_LINK.colour, VIRTUAL_LINK.marker)?;
        }
        self.chain_name(chain, x)
    }

    fn chain_name(&self, chain: &Chain, x: f64) -> Drawing {
        let name = chain
            .joints
            .first()
            .and_then(|&j| self.mechanism.joints[j].chain.as_deref())
            .unwrap_or_default();
        let lines = match chain.circuit {
            Some(number) => {
                let rows = self.mechanism.circuits[number - 1].rows;
                [
                    format!("circuit {number}"),
                    name.to_owned(),
                    format!("{rows} rows"),
                ]
            }
            None => {
                let passes = |c: &&MechanismCircuit| c.joints.iter().any(|(j, _)| chain.joints.contains(j));
                let count = self.mechanism.circuits.iter().filter(passes).count();
                [
                    "chain of the root".to_owned(),
                    name.to_owned(),
                    format!("in {count} circuits"),
                ]
            }
        };
        for (i, line) in lines.iter().enumerate() {
            let look = self.look(line, self.column_width() - 6.0, Anchor::Centre, BLACK);
            self.sheet
                .text(line, (x, self.ground + 17.0 + 14.0 * i as f64), look)?;
        }
        Ok(())
    }

    /// The virtual joints of a posture: each stands beside the real joint it imposes.
    fn beside_real_joints(&self) -> Drawing {
        let chained: Vec<usize> = self.layout.chains.iter().flat_map(|c| c.joints.clone()).collect();
        for (i, joint) in self.mechanism.joints.iter().enumerate() {
            if joint.chain.is_none() || chained.contains(&i) {
                continue;
            }
            self.arrow(&self.way_down(joint, BESIDE), joint)?;
        }
        Ok(())
    }

    fn node(&self, link: usize) -> Drawing {
        let (x, y) = self.at(link);
        let node = &self.mechanism.links[link];
        let room = self.column_width() - 6.0;
        let look = self.look(&node.name, room, Anchor::Centre, BLACK);
        let half = text_width(&node.name, look.size) / 2.0 + 5.0;
        let (low, high) = ((x - half, y - NODE_HALF), (x + half, y + NODE_HALF));
        let fill = if node.kind == LinkKind::CentreOfMass {
            PALE
        } else {
            WHITE
        };
        self.sheet.fill(low, high, fill)?;
        self.sheet.frame(low, high, BLACK)?;
        self.sheet.text(&node.name, (x, y), look)
    }

    fn arrow(&self, points: &[Point], joint: &MechanismJoint) -> Drawing {
        let (_, colour) = colour(joint.role);
        let stroke = Stroke {
            colour,
            width: 2.0,
            dash: dash(joint),
        };
        self.sheet.line(points, stroke)?;
        let [.., from, to] = points else { return Ok(()) };
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let length = dx.hypot(dy).max(1e-9);
        let (ux, uy) = (7.0 * dx / length, 7.0 * dy / length);
        let back = (to.0 - ux, to.1 - uy);
        let head = [
            *to,
            (back.0 - uy * 0.5, back.1 + ux * 0.5),
            (back.0 + uy * 0.5, back.1 - ux * 0.5),
        ];
        self.sheet.area(&head, colour)
    }

    /// A text no wider than `room`.
    fn look(&self, text: &str, room: f64, anchor: Anchor, colour: RGBColor) -> Type {
        let size = (TEXT * room / text_width(text, TEXT)).clamp(LEAST_TEXT, TEXT);
        Type { size, anchor, colour }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ik_methods::davies::MechanismLink;

    /// Ground, a base that is fixed to it, one arm with one joint, and a chain of two joints to the arm.
    fn fixed_arm() -> Mechanism {
        let link = |name: &str, kind| MechanismLink {
            name: name.to_owned(),
            kind,
        };
        let joint = |name: &str, from, to, chain: Option<&str>, role| MechanismJoint {
            name: name.to_owned(),
            from,
            to,
            chain: chain.map(str::to_owned),
            role,
        };
        Mechanism {
            links: vec![
                link("ground", LinkKind::Ground),
                link("base", LinkKind::Body),
                link("arm", LinkKind::Body),
                link("V tip 1", LinkKind::Virtual),
            ],
            joints: vec![
                joint("elbow", 1, 2, None, Role::Secondary),
                joint("tip px", 0, 3, Some("tip"), Role::Imposed),
                joint("tip rz", 3, 2, Some("tip"), Role::Secondary),
                joint("rest elbow", 1, 2, Some("rest"), Role::Compromised),
            ],
            circuits: vec![
                MechanismCircuit {
                    task: "tip".to_owned(),
                    joints: vec![(0, 1), (2, -1), (1, -1)],
                    rows: 2,
                },
                MechanismCircuit {
                    task: "rest".to_owned(),
                    joints: vec![(0, 1), (3, -1)],
                    rows: 1,
                },
            ],
            blocks: Vec::new(),
            followers: Vec::new(),
            imposed_root: None,
        }
    }

    #[test]
    fn links_joints_roles_and_counts_are_all_there() {
        let svg = mechanism_svg(&fixed_arm(), "arm < leg").unwrap();
        for text in [
            "arm &lt; leg",
            "base",
            "elbow",
            "px",
            "rz",
            "circuit 1",
            "virtual joint: primary, imposed",
            "virtual joint: primary, compromised",
            "virtual joint: secondary (monitored)",
            "4 links with the ground, 4 joints (1 real), 2 circuits. N is 3 × 4, mobility 1. Primary 2 (1",
        ] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        // A root that is fixed has no chain; a joint has one head each.
        assert!(svg.contains("fixed") && !svg.contains("chain of the root"));
        assert_eq!(svg.matches("<polygon").count(), 4);
    }
}
