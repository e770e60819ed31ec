//! What labs hand in: bytes in, tables and pictures out.

mod archive;
mod inflate;
mod manifest;
mod package;
mod picture;

pub use package::{
    FlakePictures, FlakeSlices, MultiAngle, Package, PackageBase, PackageError, SliceRoom, TableLayout,
};
pub use picture::{Picture, PictureError, PictureScratch};
