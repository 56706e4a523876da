//! What keys do in a window, without the window: camera, time and settings.

mod clock;
mod controls;
mod fly;

pub(in crate::render) use clock::{Clock, RATE};
pub(in crate::render) use controls::Controls;
pub(in crate::render) use fly::{Fly, Go};

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) enum Ask {
    Go(Go),
    /// Shift: faster.
    Fast,
    NextMode,
    NextView,
    /// A preset by its place in the list.
    Preset(usize),
    NextMarch,
    NextLayers,
    NextShadows,
    NextBehind,
    /// Larger or smaller by one step.
    Region(i32),
    Map(i32),
    Depth(i32),
    Scale(i32),
    Exposure(i32),
    Pause,
    /// Forward or back by one frame.
    Step(i32),
    FollowPath,
    PathAnew,
    Reload,
    Picture,
    Times,
    Plan,
    Help,
    FullScreen,
    Quit,
}

impl Ask {
    /// True if holding the key down asks again and again.
    pub(in crate::render) const fn repeats(self) -> bool {
        matches!(self, Self::Step(_) | Self::Region(_) | Self::Exposure(_))
    }
}
