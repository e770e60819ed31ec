//! Paints in the order of how near they are to a color.

use super::documents::{PaintList, PaintSummary};
use crate::paint::ASPECULAR_DEG;
use crate::service::app::App;
use crate::service::http::Problem;
use crate::service::work::colors;
use crate::store::Visibility;
use crate::workshop::color_difference;

/// Largest magnitude of L, a and b.
const MOST_LAB: f64 = 2000.0;

/// Aspecular angle unless one is given, degrees: the face of a paint.
const USUAL_DEG: f64 = 45.0;

/// Digits of a difference, and of an id after its prefix, in a cursor.
const DIGITS: (usize, usize) = (16, 32);

/// A color, and the angle at which paints are compared with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Color {
    lab: [f64; 3],
    /// Place of the angle among those of the instruments.
    place: usize,
}

/// Where a paint stands in the order: difference, then id. Differences are not negative, so that their bits ascend with
/// them.
type Rank = (u64, String);

impl Color {
    /// The color that a query asks for, if it asks for one.
    ///
    /// # Errors
    ///
    /// [`Problem`] for anything but three numbers in range, an angle that no instrument has, and one without a color.
    pub fn of_query(near: Option<&[f64]>, angle: Option<f64>) -> Result<Option<Self>, Problem> {
        let Some(near) = near else {
            return match angle {
                None => Ok(None),
                Some(_) => Err(Problem::parameter("angle", "angle stands without near.")
                    .accepting("angle beside near=L,a,b")),
            };
        };
        let of_near =
            |detail: String, accepted: &str| Problem::parameter("near", detail).accepting(accepted);
        let lab = <[f64; 3]>::try_from(near).map_err(|_| {
            let detail = format!("near has {} numbers.", near.len());
            of_near(detail, "3 numbers: L,a,b under D65 for the 2° observer")
        })?;
        if !(0.0..=MOST_LAB).contains(&lab[0]) || lab.iter().any(|v| v.abs() > MOST_LAB) {
            let [l, a, b] = lab;
            let accepted = "L from 0 to 2000, a and b from -2000 to 2000";
            return Err(of_near(format!("near is {l},{a},{b}."), accepted));
        }
        let angle = angle.unwrap_or(USUAL_DEG);
        let place = ASPECULAR_DEG.iter().position(|own| *own == angle);
        let place = place.ok_or_else(|| {
            let angles = ASPECULAR_DEG.map(|angle| angle.to_string()).join(", ");
            Problem::parameter("angle", format!("angle is {angle}."))
                .accepting(format!("one of {angles}"))
        })?;
        Ok(Some(Self { lab, place }))
    }

    /// A page of paints, the nearest first and those equally near by their ids.
    ///
    /// # Errors
    ///
    /// [`Problem`] for a cursor of another list, and when the store fails.
    pub async fn page(
        &self,
        app: &App,
        q: Option<&str>,
        visibility: Visibility,
        cursor: Option<&str>,
        limit: usize,
    ) -> Result<PaintList, Problem> {
        let after = cursor.map(rank_of).transpose()?;
        let all = colors::of_paints(app, q, visibility).await?;
        let ranked = all.into_iter().map(|paint| {
            let lab = paint.labs[self.place];
            let bits = color_difference(lab, self.lab).to_bits();
            ((bits, paint.id), lab)
        });
        let mut ranked: Vec<(Rank, [f64; 3])> = ranked
            .filter(|(rank, _)| after.as_ref().is_none_or(|after| rank > after))
            .collect();
        ranked.sort_by(|x, y| x.0.cmp(&y.0));
        let more = ranked.len() > limit;
        ranked.truncate(limit);
        let last = ranked.last().filter(|_| more);
        let next = last.map(|((bits, id), _)| format!("{bits:016x}{}", &id[2..]));
        let mut paints = Vec::with_capacity(ranked.len());
        for ((bits, id), lab) in ranked {
            // One that was deleted a moment ago is not there any more.
            if let Some(record) = app.catalogue.paint(&id).await? {
                paints.push(PaintSummary {
                    delta_e: Some(f64::from_bits(bits)),
                    lab: Some(lab),
                    ..record.into()
                });
            }
        }
        Ok(PaintList { paints, next })
    }
}

fn rank_of(cursor: &str) -> Result<Rank, Problem> {
    let hex = |text: &str| text.bytes().all(|b| b.is_ascii_hexdigit());
    let parts = cursor.split_at_checked(DIGITS.0);
    let bits = parts
        .filter(|(bits, id)| hex(bits) && hex(id) && id.len() == DIGITS.1)
        .and_then(|(bits, id)| Some((u64::from_str_radix(bits, 16).ok()?, format!("p_{id}"))));
    bits.ok_or_else(|| {
        Problem::parameter("cursor", "The cursor was not made by a list of this order.")
            .accepting("`next` of the page before")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_color_is_three_numbers_at_an_angle_that_instruments_have() {
        let color = |near: &[f64], angle| Color::of_query(Some(near), angle);
        let usual = color(&[50.0, 0.0, 0.0], None).expect("a color");
        assert_eq!(
            usual,
            color(&[50.0, 0.0, 0.0], Some(45.0)).expect("a color")
        );
        for (near, angle, pointer) in [
            (&[50.0, 0.0][..], None, "/near"),
            (&[], None, "/near"),
            (&[50.0, 0.0, 0.0, 0.0], None, "/near"),
            (&[-1.0, 0.0, 0.0], None, "/near"),
            (&[50.0, 2001.0, 0.0], None, "/near"),
            (&[50.0, 0.0, 0.0], Some(44.0), "/angle"),
        ] {
            let told = color(near, angle).expect_err("is refused").document(None);
            assert_eq!(told.pointer.as_deref(), Some(pointer), "{told:?}");
            assert!(told.accepted.is_some(), "{told:?}");
        }
        assert_eq!(Color::of_query(None, None), Ok(None));
        assert!(Color::of_query(None, Some(45.0)).is_err());
    }

    #[test]
    fn a_cursor_reads_back_and_others_are_refused() {
        let id = "0123456789abcdef".repeat(2);
        let cursor = format!("{:016x}{id}", 2.5_f64.to_bits());
        assert_eq!(rank_of(&cursor), Ok((2.5_f64.to_bits(), format!("p_{id}"))));
        for other in [
            "",
            "1f",
            "é",
            &cursor[1..],
            &format!("{cursor}0"),
            &"+".repeat(48),
        ] {
            assert!(rank_of(other).is_err(), "{other}");
        }
    }
}
