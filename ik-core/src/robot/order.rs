//! The order of a tree: which link is the root, and the links depth first from there.

use super::error::{Place, RobotError};

/// A joint between two links, given by their indices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge<'a> {
    pub(super) joint: &'a str,
    pub(super) place: &'a Place,
    pub(super) parent: usize,
    pub(super) child: usize,
}

/// A link in depth-first order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Visit {
    /// Index of the link.
    pub(super) link: usize,
    /// Index of the joint that leads to it; `None` for the root.
    pub(super) via: Option<usize>,
    /// Place of the parent link in this order; 0 for the root itself.
    pub(super) parent: usize,
}

/// The links depth first from the root, siblings in the order of their joints.
pub(super) fn depth_first(
    place: &Place,
    links: &[&str],
    edges: &[Edge<'_>],
) -> Result<Vec<Visit>, RobotError> {
    let above = edge_above(links, edges)?;
    let root = single_root(place, links, edges, &above)?;
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
    for (j, edge) in edges.iter().enumerate() {
        children[edge.parent].push(j);
    }
    let mut visits: Vec<Visit> = Vec::with_capacity(links.len());
    let mut pending = vec![Visit {
        link: root,
        via: None,
        parent: 0,
    }];
    while let Some(visit) = pending.pop() {
        let parent = visits.len();
        visits.push(visit);
        let below = |&j: &usize| Visit {
            link: edges[j].child,
            via: Some(j),
            parent,
        };
        pending.extend(children[visit.link].iter().rev().map(below));
    }
    match unreached(&visits, links.len()) {
        Some(link) => Err(cycle(links, edges, &above, link)),
        None => Ok(visits),
    }
}

/// The joint above each link; at most one is allowed.
fn edge_above(links: &[&str], edges: &[Edge<'_>]) -> Result<Vec<Option<usize>>, RobotError> {
    let mut above = vec![None; links.len()];
    for (j, edge) in edges.iter().enumerate() {
        if let Some(first) = above[edge.child].replace(j) {
            let first: &Edge<'_> = &edges[first];
            return Err(RobotError::TwoParents {
                place: edge.place.clone(),
                link: links[edge.child].to_owned(),
                first: first.joint.to_owned(),
                second: edge.joint.to_owned(),
            });
        }
    }
    Ok(above)
}

fn single_root(
    place: &Place,
    links: &[&str],
    edges: &[Edge<'_>],
    above: &[Option<usize>],
) -> Result<usize, RobotError> {
    let roots: Vec<usize> = (0..links.len()).filter(|&link| above[link].is_none()).collect();
    match roots.as_slice() {
        [root] => Ok(*root),
        [] => Err(cycle(links, edges, above, 0)),
        several => {
            let roots = several.iter().map(|&link| links[link].to_owned()).collect();
            Err(RobotError::SeveralRoots {
                place: place.clone(),
                roots,
            })
        }
    }
}

fn unreached(visits: &[Visit], links: usize) -> Option<usize> {
    let mut reached = vec![false; links];
    for visit in visits {
        reached[visit.link] = true;
    }
    reached.iter().position(|&reached| !reached)
}

/// The error for the cycle above a link that has no root above it.
fn cycle(links: &[&str], edges: &[Edge<'_>], above: &[Option<usize>], start: usize) -> RobotError {
    let up = |link: usize| above[link].map_or(link, |j| edges[j].parent);
    // After as many steps as there are links the walk is inside the cycle.
    let inside = (0..links.len()).fold(start, |link, _| up(link));
    let mut names = vec![links[inside].to_owned()];
    let mut link = up(inside);
    while link != inside {
        names.push(links[link].to_owned());
        link = up(link);
    }
    names.push(links[inside].to_owned());
    names.reverse();
    let place = above[inside].map_or_else(|| Place::of(links[inside]), |j| edges[j].place.clone());
    RobotError::Cycle { place, links: names }
}
