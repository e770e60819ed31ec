//! A blend with fewer angles: a sample of the same work.

use super::{Blend, BlendedFlakes, Boxes};
use crate::paint::SharedList;

impl Blend {
    /// The slices at these grid indices of θh and θd alone. Reports stay those of the whole.
    ///
    /// # Panics
    ///
    /// When an index is outside the grid.
    #[must_use]
    pub fn only(&self, theta_h: &[usize], theta_d: &[usize]) -> Self {
        Self {
            flakes: self.flakes.as_ref().map(|f| f.only(theta_h, theta_d)),
            paints: self.paints.clone(),
            asked: self.asked.clone(),
            settings: self.settings,
            report: self.report.clone(),
        }
    }

    /// Every `step_h`-th angle of θh and `step_d`-th of θd, and the last of each.
    #[must_use]
    pub fn thinned(&self, [step_h, step_d]: [usize; 2]) -> Self {
        match &self.flakes {
            Some(f) => self.only(&f.theta_h.every(step_h), &f.theta_d.every(step_d)),
            None => self.clone(),
        }
    }

    /// Angles of θh and of θd on the common grid; `None` when no paint has flakes.
    #[must_use]
    pub fn angles(&self) -> Option<[usize; 2]> {
        self.flakes
            .as_ref()
            .map(|f| [f.theta_h.len(), f.theta_d.len()])
    }
}

impl BlendedFlakes {
    fn only(&self, theta_h: &[usize], theta_d: &[usize]) -> Self {
        let mut kept = Self {
            theta_h: self.theta_h.at(theta_h),
            theta_d: self.theta_d.at(theta_d),
            offsets: vec![0].into(),
            probability: SharedList::default(),
            boxes: vec![Boxes::default(); self.boxes.len()],
            textures: self.textures.clone(),
            reaches: self.reaches.clone(),
        };
        for &h in theta_h {
            for &d in theta_d {
                let k = h * self.theta_d.len() + d;
                let range = self.offsets[k] as usize..self.offsets[k + 1] as usize;
                kept.probability
                    .extend_from_slice(&self.probability[range.clone()]);
                for (to, from) in kept.boxes.iter_mut().zip(&self.boxes) {
                    to.lower.extend_from_slice(&from.lower[range.clone()]);
                    to.upper.extend_from_slice(&from.upper[range.clone()]);
                }
                #[allow(clippy::cast_possible_truncation)] // no more than there were
                kept.offsets.push(kept.probability.len() as u32);
            }
        }
        kept
    }
}
