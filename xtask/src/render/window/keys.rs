//! What keys do.

use crate::render::steer::{Ask, Go};
use winit::keyboard::KeyCode;

/// A line of the help.
pub(super) struct Line {
    pub(super) keys: &'static str,
    pub(super) what: &'static str,
}

const fn line(keys: &'static str, what: &'static str) -> Line {
    Line { keys, what }
}

/// The help, in groups.
pub(super) const HELP: &[(&str, &[Line])] = &[
    (
        "Camera",
        &[
            line("W A S D", "forward, left, back, right"),
            line("Q E", "down, up"),
            line("drag", "look"),
            line("Shift, wheel", "faster; change the speed"),
            line("P", "follow the scene's path, or stop"),
            line("R", "path and animation from their beginning"),
        ],
    ),
    (
        "Picture",
        &[
            line("Tab", "hybrid or full-bvh"),
            line("1 2 3 4", "preset fast, default, fine, paper"),
            line("V", "next debug view"),
            line("- =", "traced region smaller, larger"),
            line("[ ]", "faces of the cube map coarser, finer"),
            line(", .", "depth of recursion less, more"),
            line("M", "next way to march through the map"),
            line("L", "one or two layers of the map"),
            line("B", "rays behind the map: go on, or sky"),
            line("K", "next kind of shadows"),
            line("X C", "fewer, more pixels"),
            line("PgDn PgUp", "darker, brighter"),
        ],
    ),
    (
        "Time",
        &[
            line("Space", "run or pause the animation"),
            line("Left Right", "a frame back, on"),
            line("F5", "load the scene again"),
        ],
    ),
    (
        "Window",
        &[
            line("T", "times and settings"),
            line("G", "the plan: what runs, what does not, and why"),
            line("F12", "picture to a file"),
            line("F11", "full screen"),
            line("F1 H", "this help"),
            line("Esc", "quit"),
        ],
    ),
];

/// What a key asks for, by its place on a keyboard of the United States.
pub(super) const fn ask(key: KeyCode) -> Option<Ask> {
    Some(match key {
        KeyCode::KeyW => Ask::Go(Go::Forward),
        KeyCode::KeyS => Ask::Go(Go::Back),
        KeyCode::KeyA => Ask::Go(Go::Left),
        KeyCode::KeyD => Ask::Go(Go::Right),
        KeyCode::KeyE => Ask::Go(Go::Up),
        KeyCode::KeyQ => Ask::Go(Go::Down),
        KeyCode::ShiftLeft | KeyCode::ShiftRight => Ask::Fast,
        KeyCode::Tab => Ask::NextMode,
        KeyCode::KeyV => Ask::NextView,
        KeyCode::Digit1 => Ask::Preset(0),
        KeyCode::Digit2 => Ask::Preset(1),
        KeyCode::Digit3 => Ask::Preset(2),
        KeyCode::Digit4 => Ask::Preset(3),
        KeyCode::KeyM => Ask::NextMarch,
        KeyCode::KeyL => Ask::NextLayers,
        KeyCode::KeyK => Ask::NextShadows,
        KeyCode::KeyB => Ask::NextBehind,
        KeyCode::Minus => Ask::Region(-1),
        KeyCode::Equal => Ask::Region(1),
        KeyCode::BracketLeft => Ask::Map(-1),
        KeyCode::BracketRight => Ask::Map(1),
        KeyCode::Comma => Ask::Depth(-1),
        KeyCode::Period => Ask::Depth(1),
        KeyCode::KeyX => Ask::Scale(-1),
        KeyCode::KeyC => Ask::Scale(1),
        KeyCode::PageDown => Ask::Exposure(-1),
        KeyCode::PageUp => Ask::Exposure(1),
        KeyCode::Space => Ask::Pause,
        KeyCode::ArrowLeft => Ask::Step(-1),
        KeyCode::ArrowRight => Ask::Step(1),
        KeyCode::KeyP => Ask::FollowPath,
        KeyCode::KeyR => Ask::PathAnew,
        KeyCode::F5 => Ask::Reload,
        KeyCode::F12 => Ask::Picture,
        KeyCode::KeyT => Ask::Times,
        KeyCode::KeyG => Ask::Plan,
        KeyCode::F1 | KeyCode::KeyH => Ask::Help,
        KeyCode::F11 => Ask::FullScreen,
        KeyCode::Escape => Ask::Quit,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The keys of the help by the names that are printed there.
    fn key(name: &str) -> Option<KeyCode> {
        Some(match name {
            "-" => KeyCode::Minus,
            "=" => KeyCode::Equal,
            "[" => KeyCode::BracketLeft,
            "]" => KeyCode::BracketRight,
            "," => KeyCode::Comma,
            "." => KeyCode::Period,
            "1" => KeyCode::Digit1,
            "2" => KeyCode::Digit2,
            "3" => KeyCode::Digit3,
            "4" => KeyCode::Digit4,
            "Tab" => KeyCode::Tab,
            "Space" => KeyCode::Space,
            "Left" => KeyCode::ArrowLeft,
            "Right" => KeyCode::ArrowRight,
            "PgUp" => KeyCode::PageUp,
            "PgDn" => KeyCode::PageDown,
            "Esc" => KeyCode::Escape,
            "F1" => KeyCode::F1,
            "F5" => KeyCode::F5,
            "F11" => KeyCode::F11,
            "F12" => KeyCode::F12,
            "Shift," => KeyCode::ShiftLeft,
            "A" => KeyCode::KeyA,
            "B" => KeyCode::KeyB,
            "C" => KeyCode::KeyC,
            "D" => KeyCode::KeyD,
            "E" => KeyCode::KeyE,
            "G" => KeyCode::KeyG,
            "H" => KeyCode::KeyH,
            "K" => KeyCode::KeyK,
            "L" => KeyCode::KeyL,
            "M" => KeyCode::KeyM,
            "P" => KeyCode::KeyP,
            "Q" => KeyCode::KeyQ,
            "R" => KeyCode::KeyR,
            "S" => KeyCode::KeyS,
            "T" => KeyCode::KeyT,
            "V" => KeyCode::KeyV,
            "W" => KeyCode::KeyW,
            "X" => KeyCode::KeyX,
            "drag" | "wheel" => return None,
            _ => panic!("`{name}` is no key"),
        })
    }

    #[test]
    fn every_key_of_the_help_does_something_and_no_two_the_same() {
        let lines = HELP.iter().flat_map(|(_, lines)| *lines);
        let keys: Vec<KeyCode> =
            lines.flat_map(|line| line.keys.split_whitespace()).filter_map(key).collect();
        for key in &keys {
            assert!(ask(*key).is_some(), "{key:?}");
        }
        let mut asked: Vec<String> =
            keys.iter().filter(|k| **k != KeyCode::F1).map(|k| format!("{:?}", ask(*k))).collect();
        let all = asked.len();
        asked.sort();
        asked.dedup();
        assert_eq!(asked.len(), all);
        assert_eq!(ask(KeyCode::F9), None);
    }
}
