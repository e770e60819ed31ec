//! Pictures of flakes with fewer angles: those between are never read.

use crate::measurement::{FlakePictures, PackageError, SliceRoom};
use crate::paint::AngleGrid;

/// Every n-th angle of some pictures, on either grid, and the last.
pub struct Thinned<'a> {
    pictures: &'a dyn FlakePictures,
    rows: Vec<usize>,
    columns: Vec<usize>,
    theta_h: AngleGrid,
    theta_d: AngleGrid,
}

impl<'a> Thinned<'a> {
    /// Every `step`-th angle of these pictures.
    #[must_use]
    pub fn new(pictures: &'a dyn FlakePictures, step: usize) -> Self {
        Self::by_steps(pictures, [step; 2])
    }

    /// Every n-th angle of θh and of θd.
    #[must_use]
    pub fn by_steps(pictures: &'a dyn FlakePictures, [step_h, step_d]: [usize; 2]) -> Self {
        let (rows, columns) = (
            pictures.theta_h().every(step_h),
            pictures.theta_d().every(step_d),
        );
        Self {
            theta_h: pictures.theta_h().at(&rows),
            theta_d: pictures.theta_d().at(&columns),
            pictures,
            rows,
            columns,
        }
    }

    /// Number of a slice among all pictures.
    fn whole(&self, slice: usize) -> usize {
        let (h, d) = (slice / self.columns.len(), slice % self.columns.len());
        self.rows[h] * self.pictures.theta_d().len() + self.columns[d]
    }
}

impl std::fmt::Debug for Thinned<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Thinned")
            .field("rows", &self.rows)
            .field("columns", &self.columns)
            .finish_non_exhaustive()
    }
}

impl FlakePictures for Thinned<'_> {
    fn theta_h(&self) -> &AngleGrid {
        &self.theta_h
    }

    fn theta_d(&self) -> &AngleGrid {
        &self.theta_d
    }

    fn texel_um(&self) -> f64 {
        self.pictures.texel_um()
    }

    fn size(&self) -> [u32; 2] {
        self.pictures.size()
    }

    fn name(&self, slice: usize) -> String {
        self.pictures.name(self.whole(slice))
    }

    fn read(&self, slice: usize, room: &mut SliceRoom) -> Result<(), PackageError> {
        self.pictures.read(self.whole(slice), room)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Picture;

    /// Slices whose every pixel is their number.
    struct Numbered(AngleGrid, AngleGrid);

    impl FlakePictures for Numbered {
        fn theta_h(&self) -> &AngleGrid {
            &self.0
        }
        fn theta_d(&self) -> &AngleGrid {
            &self.1
        }
        fn texel_um(&self) -> f64 {
            20.0
        }
        fn size(&self) -> [u32; 2] {
            [1, 1]
        }
        fn name(&self, slice: usize) -> String {
            slice.to_string()
        }
        fn read(&self, slice: usize, room: &mut SliceRoom) -> Result<(), PackageError> {
            room.picture = Picture {
                width: 1,
                height: 1,
                planes: [(); 3].map(|()| vec![slice as f32]),
            };
            Ok(())
        }
    }

    #[test]
    fn a_thinned_slice_is_the_picture_at_its_own_angles() {
        let grid = |n: i32| AngleGrid::new((0..n).map(f64::from).collect()).expect("ascends");
        let all = Numbered(grid(8), grid(6));
        let thin = Thinned::new(&all, 3);
        assert_eq!(thin.theta_h().degrees(), [0.0, 3.0, 6.0, 7.0]);
        assert_eq!(thin.theta_d().degrees(), [0.0, 3.0, 5.0]);
        let mut room = SliceRoom::default();
        for slice in 0..thin.slices() {
            let (h, d) = (
                thin.theta_h().degrees()[slice / 3],
                thin.theta_d().degrees()[slice % 3],
            );
            thin.read(slice, &mut room).expect("read");
            assert_eq!(f64::from(room.picture.planes[0][0]), h * 6.0 + d);
            assert_eq!(thin.name(slice), (h * 6.0 + d).to_string());
        }
    }
}
