//! Convex polygons in the plane: hull of points by the monotone chain of Andrew (1979), and the signed distance
//! of a point.

use nalgebra::Vector2;

type Point = Vector2<f64>;

/// The convex hull of some points.
#[derive(Clone, Debug)]
pub(super) struct Hull {
    /// Counter-clockwise; only two, the ends, if all points lie on one line.
    corners: Vec<Point>,
}

/// Twice the area of the triangle abc, positive if it is counter-clockwise.
fn turn(a: &Point, b: &Point, c: &Point) -> f64 {
    (b - a).perp(&(c - a))
}

/// One side of the hull, its last corner left out: it begins the other side.
fn side<'a>(sorted: impl Iterator<Item = &'a Point>) -> Vec<Point> {
    let mut side: Vec<Point> = Vec::new();
    for point in sorted {
        while let [.., a, b] = &side[..]
            && turn(a, b, point) <= 0.0
        {
            side.pop();
        }
        side.push(*point);
    }
    side.pop();
    side
}

fn segment_distance(a: &Point, b: &Point, p: &Point) -> f64 {
    let along = b - a;
    let length_squared = along.norm_squared();
    let part = if length_squared > 0.0 {
        ((p - a).dot(&along) / length_squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (p - a - along * part).norm()
}

impl Hull {
    /// The hull of at least two points.
    pub(super) fn new(mut points: Vec<Point>) -> Self {
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        let mut corners = side(points.iter());
        corners.extend(side(points.iter().rev()));
        Self { corners }
    }

    fn edges(&self) -> impl Iterator<Item = (&Point, &Point)> {
        self.corners.iter().zip(self.corners.iter().cycle().skip(1))
    }

    /// Distance of `p` to the border: positive inside, negative outside. A hull without area has no inside.
    pub(super) fn signed_distance(&self, p: &Point) -> f64 {
        let distance = self
            .edges()
            .map(|(a, b)| segment_distance(a, b, p))
            .fold(f64::INFINITY, f64::min);
        let inside = self.corners.len() > 2 && self.edges().all(|(a, b)| turn(a, b, p) >= 0.0);
        if inside { distance } else { -distance }
    }

    /// Least and largest corner coordinates.
    pub(super) fn bounds(&self) -> (Point, Point) {
        let first = self.corners[0];
        self.corners.iter().fold((first, first), |(low, high), corner| {
            (low.inf(corner), high.sup(corner))
        })
    }
}
