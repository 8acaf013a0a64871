//! Matrices of fixed size, kept by columns: no index, so none is out of range.

use core::array::from_fn;
use core::ops::{Add, Mul, Sub};

/// `f32` or `f64`.
pub(crate) trait Number: Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {}

impl Number for f32 {}
impl Number for f64 {}

/// Its columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Matrix<T, const ROWS: usize, const COLUMNS: usize>(pub(crate) [[T; ROWS]; COLUMNS]);

impl<T: Number, const ROWS: usize, const COLUMNS: usize> Matrix<T, ROWS, COLUMNS> {
    #[inline(always)]
    pub(crate) fn zeros() -> Self {
        Self([[T::default(); ROWS]; COLUMNS])
    }

    #[inline(always)]
    pub(crate) fn map<U>(self, to: impl Fn(T) -> U) -> Matrix<U, ROWS, COLUMNS> {
        Matrix(self.0.map(|column| column.map(&to)))
    }

    #[inline(always)]
    pub(crate) fn times(self, factor: T) -> Self {
        self.map(|number| number * factor)
    }

    /// Number by number.
    #[inline(always)]
    pub(crate) fn with(mut self, other: Self, join: impl Fn(T, T) -> T) -> Self {
        self.iter_mut().zip(other.iter()).for_each(|(to, from)| *to = join(*to, *from));
        self
    }

    /// With a product.
    #[inline(always)]
    pub(crate) fn plus<const BETWEEN: usize>(
        mut self,
        left: Matrix<T, ROWS, BETWEEN>,
        right: Matrix<T, BETWEEN, COLUMNS>,
    ) -> Self {
        for (sums, weights) in self.0.iter_mut().zip(right.0) {
            for (column, weight) in left.0.iter().zip(weights) {
                sums.iter_mut().zip(column).for_each(|(sum, number)| *sum = *number * weight + *sum);
            }
        }
        self
    }

    /// By columns.
    #[inline(always)]
    pub(crate) fn iter(&self) -> impl Iterator<Item = &T> {
        self.0.as_flattened().iter()
    }

    #[inline(always)]
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.0.as_flattened_mut().iter_mut()
    }

    pub(crate) fn transpose(self) -> Matrix<T, COLUMNS, ROWS> {
        let mut rows = self.0.map(IntoIterator::into_iter);
        Matrix(from_fn(|_| rows.each_mut().map(|row| row.next().unwrap_or_default())))
    }
}

impl<T: Number, const SIZE: usize> Matrix<T, SIZE, SIZE> {
    pub(crate) fn diagonal(numbers: [T; SIZE]) -> Self {
        let mut at = 0..;
        Self(numbers.map(|number| {
            let place = at.next();
            from_fn(|row| if Some(row) == place { number } else { T::default() })
        }))
    }
}

impl<T: Number> Matrix<T, 1, 4> {
    /// A row times a column.
    #[inline(always)]
    pub(crate) fn dot(self, column: Matrix<T, 4, 1>) -> T {
        let Matrix([[product]]) = self * column;
        product
    }
}

impl<T: Number, const ROWS: usize, const COLUMNS: usize> Add for Matrix<T, ROWS, COLUMNS> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl<T: Number, const ROWS: usize, const COLUMNS: usize> Sub for Matrix<T, ROWS, COLUMNS> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl<T: Number, const ROWS: usize, const BETWEEN: usize, const COLUMNS: usize> Mul<Matrix<T, BETWEEN, COLUMNS>>
    for Matrix<T, ROWS, BETWEEN>
{
    type Output = Matrix<T, ROWS, COLUMNS>;

    // A call: no tick needs it, and what is unrolled fills the flash.
    #[inline(never)]
    fn mul(self, right: Matrix<T, BETWEEN, COLUMNS>) -> Self::Output {
        Matrix::zeros().plus(self, right)
    }
}
