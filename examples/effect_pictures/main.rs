//! Draws the pictures of docs/explanation/effects.md: each effect alone.
//! `cargo run --release --example effect_pictures`.

mod draw;
mod pictures;

use draw::png;
use pictures::PICTURES;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/effects");
    std::fs::create_dir_all(&folder)?;
    for picture in PICTURES {
        let file = folder.join(picture.file());
        std::fs::write(&file, png(picture)?)?;
        println!("{}", file.display());
    }
    Ok(())
}
