//! Additional scenes, for bounds that the scenes of the repository do not reach.

use crate::fixtures::scene;
use skyloop::config::Config;

/// Names and configurations.
pub fn scenes() -> Vec<(String, Config)> {
    // The loss of an amplifier at a full pixel, e-: below what `fast` and `realtime` may skip.
    let bent = |missing_e: f64| {
        let mut config = scene("bright-star.toml");
        let detector = &mut config.camera.detector;
        detector.nonlinearity = missing_e / detector.full_well_e;
        config
    };
    // So short that all light of the sky is lost in noise within the tolerance of `realtime`, too.
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
