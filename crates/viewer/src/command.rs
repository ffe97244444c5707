//! The shell command that renders the picture at rest.

use crate::state::State;
use snell_intersect::AcceleratorKind;
use snell_persist::camera_definitions;
use snell_render::{IntegratorKind, Request};

impl State {
    /// The command that renders the picture at rest, quoted for a shell.
    pub fn command(&self) -> String {
        self.command_words().iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" ")
    }

    /// The words of the command that renders the picture at rest.
    pub fn command_words(&self) -> Vec<String> {
        let (settings, camera, opened) = (&self.settings, &self.camera, &self.opened);
        let mut words: Vec<String> = opened.command.clone();
        let mut option = |name: &str, value: String| {
            // What was given when the scene was opened is given once, as it is now.
            if name != "-D" {
                remove(&mut words, name);
            }
            words.extend([name.to_string(), value]);
        };
        option("--size", format!("{}x{}", settings.size[0], settings.size[1]));
        option("--spp", settings.spp.to_string());
        option("-i", settings.integrator.name().into());
        let is_given = opened.command.iter().any(|word| word.starts_with("--aov"));
        let is_same = is_given && settings.aovs == opened.settings.aovs;
        if settings.integrator == IntegratorKind::Aov && !is_same {
            option("--aov", settings.aovs.first().map_or("normal", |a| a.name()).into());
        }
        option("--max-depth", settings.max_depth.to_string());
        if settings.build.accelerator != AcceleratorKind::default() {
            option("--accelerator", settings.build.accelerator.name().into());
        }
        let live = Request::SETTINGS.iter().filter(|setting| setting.is_live);
        for setting in live {
            let before = setting.get(&opened.request);
            if let Some(now) = setting.get(&self.request).filter(|now| before.as_ref() != Some(now))
            {
                option(&format!("--{}", setting.option()), now);
            }
        }
        if self.display.tonemap != opened.display.tonemap {
            option("--tonemap", self.display.tonemap.name().into());
        }
        for edit in self.history.standing() {
            option("-D", edit.to_string());
        }
        if let Some(moment) = &self.moment {
            option("--at", moment.time.to_string());
            if let Some(clip) = &moment.clip {
                option("--animation", clip.clone());
            }
            // A camera of its own, because those of the file may move.
            let number = self.scene.cameras.len();
            let camera = serde_json::to_string(camera).unwrap_or_default();
            option("-D", format!("camera.{number}={camera}"));
            option("--camera", number.to_string());
        } else if *camera != self.usual {
            let number = opened.camera_number;
            for definition in camera_definitions(number, &self.usual, camera, false) {
                option("-D", definition);
            }
        }
        if self.display.exposure != opened.display.exposure {
            // In one word, because the number may be negative.
            remove(&mut words, "--exposure");
            words.push(format!("--exposure={}", self.display.exposure));
        }
        words
    }
}

/// The other spelling of options that have a letter.
const LETTERS: [(&str, &str); 2] = [("-i", "--integrator"), ("--size", "-s")];

/// Removes an option that takes a value, in any spelling, behind the three words `snell render
/// SCENE`.
fn remove(words: &mut Vec<String>, option: &str) {
    let other = LETTERS.iter().find(|(name, _)| *name == option).map_or(option, |(_, other)| other);
    let is_option = |word: &str| [option, other].contains(&word);
    let has_value = |word: &str| {
        [option, other].iter().any(|name| match word.strip_prefix(name) {
            Some(rest) if name.starts_with("--") => rest.starts_with('='),
            Some(rest) => !rest.is_empty(),
            None => false,
        })
    };
    let mut i = 3;
    while i < words.len() {
        if is_option(&words[i]) {
            words.drain(i..(i + 2).min(words.len()));
        } else if has_value(&words[i]) {
            words.remove(i);
        } else {
            i += 1;
        }
    }
}

/// A word quoted for a shell.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_string();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_is_removed_in_any_spelling() {
        let line =
            "snell render -s -s 4x3 --spp 4 --size=8x6 --samples 2 -ipath --integrator ao --spp";
        let mut words: Vec<String> = line.split(' ').map(String::from).collect();
        for option in ["--spp", "--size", "-i"] {
            remove(&mut words, option);
        }
        assert_eq!(words.join(" "), "snell render -s --samples 2");
    }
}
