//! The mesh that shows the material: a ball with its texels in their true size.
//!
//! It is half as large as the preview's: viewers average texels that are smaller than a pixel, where the preview draws
//! them one by one, and from twice as near the same flakes stand out. The baked tile goes a whole number of times around
//! the equator, at least twice and at most 512 times, which makes the ball a little smaller or larger than 20 mm for tiles
//! of 0.2 to 20 mm, and as small or large as they are beyond. On another mesh the texture repeats as often as its uv say:
//! flakes keep their size where a tile spans `tile_um`.

use std::f64::consts::{PI, TAU};

/// Radius of the ball, meters.
const RADIUS: f64 = 0.01;
/// Most tiles from pole to pole: texels of a micrometre are no finer on a screen for being more.
const MOST_PAIRS: f64 = 256.0;
const AROUND: u16 = 64;
const DOWN: u16 = 32;

/// Vertices in parallel lists, and triangles.
pub(super) struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub tangents: Vec<[f32; 4]>,
    pub uv: Vec<[f32; 2]>,
    pub triangles: Vec<u16>,
    /// Radius in meters.
    pub radius: f64,
    /// Times the tile goes around the equator; half as often from pole to pole.
    pub repeats: u32,
}

/// A ball whose uv repeat a tile of `tile_um` micrometres; `None` for a paint without texels.
pub(super) fn ball(tile_um: Option<f64>) -> Mesh {
    let tile = tile_um.map_or(TAU * RADIUS, |um| um * 1e-6);
    // As many from pole to pole as there are, whole too.
    let pairs = (PI * RADIUS / tile).round().clamp(1.0, MOST_PAIRS);
    let (repeats, radius) = (2.0 * pairs, 2.0 * pairs * tile / TAU);
    let mut mesh = Mesh {
        positions: Vec::new(),
        normals: Vec::new(),
        tangents: Vec::new(),
        uv: Vec::new(),
        triangles: Vec::new(),
        radius,
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most twice MOST_PAIRS
        repeats: repeats as u32,
    };
    let narrow = |v: f64| {
        #[allow(clippy::cast_possible_truncation)] // glTF's precision
        let v = v as f32;
        v
    };
    for row in 0..=DOWN {
        let v = f64::from(row) / f64::from(DOWN);
        let (ring, y) = (PI * v).sin_cos();
        for column in 0..=AROUND {
            let u = f64::from(column) / f64::from(AROUND);
            let (sine, cosine) = (TAU * u).sin_cos();
            let normal = [ring * sine, y, ring * cosine];
            mesh.positions.push(normal.map(|c| narrow(radius * c)));
            mesh.normals.push(normal.map(narrow));
            mesh.tangents.push([cosine, 0.0, -sine, 1.0].map(narrow));
            mesh.uv.push([repeats * u, repeats / 2.0 * v].map(narrow));
        }
    }
    let at = |row: u16, column: u16| row * (AROUND + 1) + column;
    for row in 0..DOWN {
        for column in 0..AROUND {
            // At the poles one of the two triangles has no area.
            if row > 0 {
                mesh.triangles.extend([
                    at(row, column),
                    at(row + 1, column + 1),
                    at(row, column + 1),
                ]);
            }
            if row + 1 < DOWN {
                mesh.triangles.extend([
                    at(row, column),
                    at(row + 1, column),
                    at(row + 1, column + 1),
                ]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_face_outwards() {
        let mesh = ball(Some(5120.0));
        for corner in mesh.triangles.chunks(3) {
            let [a, b, c] = [0, 1, 2].map(|k| {
                mesh.positions[usize::from(corner[k])].map(|v| f64::from(v) / mesh.radius)
            });
            let (u, v): ([f64; 3], [f64; 3]) = (
                std::array::from_fn(|k| b[k] - a[k]),
                std::array::from_fn(|k| c[k] - a[k]),
            );
            let n = [
                u[1] * v[2] - u[2] * v[1],
                u[2] * v[0] - u[0] * v[2],
                u[0] * v[1] - u[1] * v[0],
            ];
            assert!(n[0] * a[0] + n[1] * a[1] + n[2] * a[2] > 0.0);
        }
    }

    #[test]
    fn the_uv_of_a_texel_span_a_texel() {
        for texel_um in [0.5, 4.0, 20.0, 39.0, 400.0] {
            let tile_um = 256.0 * texel_um;
            let mesh = ball(Some(tile_um));
            let around = TAU * mesh.radius;
            assert!((around / f64::from(mesh.repeats) - tile_um * 1e-6).abs() < 1e-12);
            let last = mesh.uv.last().expect("vertices");
            let repeats = mesh.repeats as f32;
            assert_eq!(*last, [repeats, repeats / 2.0]);
        }
        let ball = ball(Some(256.0 * 20.0));
        assert!(
            (ball.radius - RADIUS).abs() < 0.1 * RADIUS,
            "{}",
            ball.radius
        );
    }
}
