//! The mesh that shows the material: a ball as large as makes its texels true.
//!
//! The baked tile goes eight times around the equator, so a ball of a paint with 20 µm texels is 13 mm wide: moved onto
//! a car, the texture repeats as often as the uv says, and the flakes keep their size.

use std::f64::consts::{PI, TAU};

/// Times the tile goes around the equator; half as often from pole to pole.
pub(super) const REPEATS: u32 = 8;
/// Radius of a ball without texels, meters.
const PLAIN_RADIUS: f64 = 0.05;
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
}

/// A ball whose uv repeat a tile of `tile_um` micrometres; `None` for a paint without texels.
pub(super) fn ball(tile_um: Option<f64>) -> Mesh {
    let radius = tile_um.map_or(PLAIN_RADIUS, |um| f64::from(REPEATS) * um * 1e-6 / TAU);
    let mut mesh = Mesh {
        positions: Vec::new(),
        normals: Vec::new(),
        tangents: Vec::new(),
        uv: Vec::new(),
        triangles: Vec::new(),
        radius,
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
            let repeats = f64::from(REPEATS);
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
        let tile_um = 256.0 * 20.0;
        let mesh = ball(Some(tile_um));
        let around = TAU * mesh.radius;
        assert!((around / f64::from(REPEATS) - tile_um * 1e-6).abs() < 1e-12);
    }
}
