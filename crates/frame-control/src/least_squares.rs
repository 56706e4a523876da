//! Linear least squares whose coefficients are never negative.

/// A row of a system: the sum of coefficients times `features` should be `value`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<const N: usize> {
    /// How much there was of each kind of work.
    pub features: [f64; N],
    /// What all of it took.
    pub value: f64,
    /// How much the square of this row's error counts, 0 and more.
    pub weight: f64,
}

/// The coefficients that fit best of those that are not negative, because work never takes negative
/// time. While a coefficient is negative, the most negative one is set to zero and the rest solved
/// again (the inner loop of Lawson and Hanson 1974, *Solving Least Squares Problems*, chapter 23).
///
/// `ridge` is the share of its own weight by which each coefficient is drawn to zero, so that features
/// that always vary together share what they cost; 1e-4 is a usual value. A feature that was never
/// there gets 0, and so do all where a number is not finite or there is no row.
///
/// ```
/// use niwaki_frame_control::{Row, least_squares};
///
/// let time = |pixels: f64, rays: f64| Row { features: [1.0, pixels, rays], value: 2.0 + 3.0 * rays, weight: 1.0 };
/// let rows = [time(1.0, 0.0), time(1.0, 4.0), time(2.0, 1.0), time(3.0, 9.0)];
/// let [constant, pixels, rays] = least_squares(rows, 1e-9);
/// assert!((constant - 2.0).abs() < 1e-3 && pixels < 1e-3 && (rays - 3.0).abs() < 1e-3);
/// ```
#[must_use]
pub fn least_squares<const N: usize>(
    rows: impl IntoIterator<Item = Row<N>>,
    ridge: f64,
) -> [f64; N] {
    let mut products = [[0.0; N]; N];
    let mut sums = [0.0; N];
    for Row { features, value, weight } in rows {
        for i in 0..N {
            for j in 0..N {
                products[i][j] += weight * features[i] * features[j];
            }
            sums[i] += weight * features[i] * value;
        }
    }
    for (i, row) in products.iter_mut().enumerate() {
        // Relative, so that the unit of a feature does not matter.
        row[i] *= 1.0 + ridge;
    }
    // A feature that was never there costs nothing.
    let mut free: [bool; N] = core::array::from_fn(|i| products[i][i] > 0.0);
    loop {
        let solution = solve_free(&products, &sums, &free);
        let most_negative = (0..N)
            .filter(|&i| solution[i] < 0.0)
            .min_by(|&i, &j| solution[i].total_cmp(&solution[j]));
        match most_negative {
            Some(i) => free[i] = false,
            None => return solution,
        }
    }
}

/// Solves products · coefficients = sums for the free ones, the others being zero, by Gauss's
/// elimination: the matrix is positive definite, so no pivoting is needed.
fn solve_free<const N: usize>(
    products: &[[f64; N]; N],
    sums: &[f64; N],
    free: &[bool; N],
) -> [f64; N] {
    let mut matrix = *products;
    let mut right = *sums;
    for i in 0..N {
        for j in 0..N {
            if !free[i] || !free[j] {
                matrix[i][j] = f64::from(u8::from(i == j));
            }
        }
        if !free[i] {
            right[i] = 0.0;
        }
    }
    for column in 0..N {
        let pivot = matrix[column];
        // Rounding may leave nothing of the ridge.
        let diagonal = pivot[column].max(f64::MIN_POSITIVE);
        for row in column + 1..N {
            let share = matrix[row][column] / diagonal;
            for (entry, above) in matrix[row].iter_mut().zip(&pivot).skip(column) {
                *entry -= share * above;
            }
            right[row] -= share * right[column];
        }
    }
    let mut solution = [0.0; N];
    for row in (0..N).rev() {
        let known: f64 = (row + 1..N).map(|j| matrix[row][j] * solution[j]).sum();
        let value = (right[row] - known) / matrix[row][row].max(f64::MIN_POSITIVE);
        solution[row] = if value.is_finite() { value } else { 0.0 };
    }
    solution
}
