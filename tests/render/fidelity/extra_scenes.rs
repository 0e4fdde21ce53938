//! Scenes beside those of the repository, that reach bounds which these do not.

use crate::fixtures::scene;
use skyloop::config::Config;

/// Their names and what they are.
pub fn scenes() -> Vec<(String, Config)> {
    // What an amplifier misses of a full pixel, e-: below what `fast` and `realtime` may skip.
    let bent = |missing_e: f64| {
        let mut config = scene("bright-star.toml");
        let detector = &mut config.camera.detector;
        detector.nonlinearity = missing_e / detector.full_well_e;
        config
    };
    // So short that all light of the sky is lost in noise by the tolerance of `realtime`, too.
    let mut short = scene("fine-pointing.toml");
    short.camera.exposure_s /= 10.0;
    let scenes = [
        ("nearly linear", bent(0.3)),
        ("more nearly linear", bent(0.03)),
        ("short exposure", short),
    ];
    scenes
        .map(|(name, config)| (name.to_string(), config))
        .into()
}
