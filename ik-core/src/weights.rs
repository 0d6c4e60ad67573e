//! Factors of weight matrices: minimising `δᵀ Q δ` is minimising `‖R δ‖²` with `Q = RᵀR`.

use crate::task::Weights;
use nalgebra::DMatrix;

/// A factor R of a weight matrix Q = RᵀR.
#[derive(Clone, Debug, PartialEq)]
pub enum WeightFactor {
    /// A diagonal.
    Diagonal(Vec<f64>),
    /// Upper triangular, so that it multiplies in place.
    Upper(DMatrix<f64>),
}

impl WeightFactor {
    /// The factor for a task of `rows` rows; none for the identity, which has nothing to do.
    pub fn new(weights: &Weights, rows: usize) -> Option<Self> {
        match weights {
            #[allow(clippy::float_cmp, reason = "exactly one means nothing to do")]
            Weights::Uniform(w) if *w == 1.0 => None,
            Weights::Uniform(w) => Some(Self::Diagonal(vec![w.sqrt(); rows])),
            Weights::Diagonal(d) => Some(Self::Diagonal(d.iter().map(|w| w.sqrt()).collect())),
            Weights::Matrix(m) => {
                // Q may be singular: QR of its symmetric square root instead of a Cholesky factorisation.
                let eigen = DMatrix::from_fn(rows, rows, |i, j| m[i][j]).symmetric_eigen();
                let root = eigen.eigenvalues.map(|l| l.max(0.0).sqrt());
                let root = DMatrix::from_diagonal(&root) * eigen.eigenvectors.transpose();
                Some(Self::Upper(root.qr().r()))
            }
        }
    }

    /// `v ← R v` in place for the leading rows of `v`.
    pub fn multiply(&self, v: &mut [f64]) {
        self.multiply_rows(v, 1);
    }

    /// `M ← R M` in place for the leading rows of a matrix whose rows follow each other every `width` numbers.
    pub fn multiply_rows(&self, m: &mut [f64], width: usize) {
        match self {
            Self::Diagonal(d) => {
                for (row, d) in m.chunks_exact_mut(width).zip(d) {
                    row.iter_mut().for_each(|x| *x *= d);
                }
            }
            Self::Upper(r) => {
                // Row i needs only rows from i on, which are still the old ones.
                for i in 0..r.nrows() {
                    for k in 0..width {
                        m[i * width + k] = (i..r.ncols()).map(|j| r[(i, j)] * m[j * width + k]).sum();
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_squares_to_the_weights() {
        let q = vec![vec![4.0, 1.0, 0.5], vec![1.0, 3.0, -1.0], vec![0.5, -1.0, 2.0]];
        let cases = [
            Weights::Uniform(9.0),
            Weights::Diagonal(vec![4.0, 0.0, 2.0]),
            Weights::Matrix(q),
        ];
        for weights in cases {
            let factor = WeightFactor::new(&weights, 3).unwrap();
            // R times the identity, rows of three.
            let mut r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
            factor.multiply_rows(&mut r, 3);
            let r = DMatrix::from_row_slice(3, 3, &r);
            let wanted = match &weights {
                Weights::Uniform(w) => DMatrix::from_diagonal_element(3, 3, *w),
                Weights::Diagonal(d) => DMatrix::from_fn(3, 3, |i, j| if i == j { d[i] } else { 0.0 }),
                Weights::Matrix(m) => DMatrix::from_fn(3, 3, |i, j| m[i][j]),
            };
            assert!((r.tr_mul(&r) - &wanted).amax() < 1e-14);
            let mut v = [1.0, -2.0, 3.0];
            factor.multiply(&mut v);
            let expected = &r * nalgebra::Vector3::new(1.0, -2.0, 3.0);
            assert!((0..3).all(|i| (v[i] - expected[i]).abs() < 1e-14));
        }
        assert!(WeightFactor::new(&Weights::Uniform(1.0), 3).is_none());
    }
}
