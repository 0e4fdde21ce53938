//! The Earth and its air around the observer, shared by all area sources of a view.

use super::horizon::Horizon;
use crate::scene::view::View;
use crate::scene::world::World;
use crate::sky::atmosphere::Limb;
use crate::sky::shadow::Earth;
use std::borrow::Cow;
use std::cell::OnceCell;
use std::sync::Arc;

/// Air above this height (m) is ignored. Only 0.1 % of the highest layer, at 250 km, lies above.
const AIR_M: f64 = 400e3;

/// Why an observer without an orbit sees no Earth.
pub const NO_ORBIT: &str =
    "the observer has no orbit (observer.orbit), and sees no Earth from its centre";

/// Why a body is not in the field: its limb is at least `nearest` rad away.
pub fn not_in_field(body: &str, nearest: f64) -> Cow<'static, str> {
    format!("{body} is {:.1} deg from the field", nearest.to_degrees()).into()
}

/// The Earth and its air around the observer.
#[derive(Debug)]
pub struct Surroundings {
    /// The Earth; none for an observer without an orbit.
    pub horizon: Option<Horizon>,
    limb: OnceCell<Option<Arc<Limb>>>,
}

impl Surroundings {
    /// The surroundings of a view's observer.
    pub(crate) fn of(view: &View) -> Surroundings {
        Surroundings {
            horizon: Horizon::of(view),
            limb: OnceCell::new(),
        }
    }

    /// The air, where some of it may be in the field. Computed on first use.
    pub(crate) fn limb(&self, world: &World, view: &View) -> Option<Arc<Limb>> {
        let near = |horizon: &&Horizon| horizon.nearest() < horizon.height_of(AIR_M);
        let find = || {
            self.horizon.as_ref().filter(near)?;
            let sun_m = view.observer.bodies.sun_apparent_m();
            let earth = Earth::at(view.exposure.mid);
            Limb::new(&world.atmosphere, view.observer.position_m, sun_m, earth).map(Arc::new)
        };
        self.limb.get_or_init(find).clone()
    }
}
