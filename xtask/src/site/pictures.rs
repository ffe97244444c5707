//! The pictures of the site. Each is what a command on a page renders, and is kept in
//! `target/docs/pictures` under a name made of the command and of the scene that it reads.

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Samples per pixel of a draft.
const DRAFT_SPP: u32 = 8;

/// The pictures that were asked for.
pub struct Pictures {
    folder: PathBuf,
    snell: PathBuf,
    is_draft: bool,
    names: BTreeSet<String>,
    rendered: usize,
    start: Instant,
}

impl Pictures {
    /// Pictures that are kept below `folder` and rendered by the command `snell`.
    pub fn new(folder: &Path, snell: PathBuf, is_draft: bool) -> Result<Self, String> {
        let folder = folder.join("pictures");
        std::fs::create_dir_all(&folder)
            .map_err(|error| format!("{}: {error}", folder.display()))?;
        let (names, start) = (BTreeSet::new(), Instant::now());
        Ok(Self { folder, snell, is_draft, names, rendered: 0, start })
    }

    /// The file name of the picture that a command renders, which is rendered if it is not there.
    pub fn of(&mut self, command: &str) -> Result<String, String> {
        let mut words = words(command);
        if self.is_draft {
            set_samples(&mut words);
        }
        let at = words.iter().position(|word| word == "-o").map(|option| option + 1);
        let at = at.filter(|&at| at < words.len());
        let at = at.ok_or_else(|| format!("there is no -o FILE: {command}"))?;
        let output = words[at].clone();
        let (stem, extension) =
            output.rsplit_once('.').ok_or_else(|| format!("{output} has no extension"))?;
        let name = format!("{stem}-{:016x}.{extension}", key(&words));
        let path = self.folder.join(&name);
        if !path.is_file() {
            println!("{command}");
            let new = self.folder.join(format!("new.{extension}"));
            words[at] = new.display().to_string();
            self.render(&words[1..]).map_err(|error| format!("{command}: {error}"))?;
            std::fs::rename(&new, &path).map_err(|error| format!("{name}: {error}"))?;
        }
        self.names.insert(name.clone());
        Ok(name)
    }

    fn render(&mut self, arguments: &[String]) -> Result<(), String> {
        self.rendered += 1;
        let output = Command::new(&self.snell)
            .args(arguments)
            .arg("--quiet")
            .output()
            .map_err(|error| format!("{}: {error}", self.snell.display()))?;
        match output.status.success() {
            true => Ok(()),
            false => Err(String::from_utf8_lossy(&output.stderr).trim().to_string()),
        }
    }

    /// Copies the pictures that were asked for.
    pub fn copy_to(&self, folder: &Path) -> Result<(), String> {
        let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
        std::fs::create_dir_all(folder).map_err(failed)?;
        for name in &self.names {
            std::fs::copy(self.folder.join(name), folder.join(name)).map_err(failed)?;
        }
        Ok(())
    }

    /// Prints how many pictures there are and how long they took.
    pub fn report(&self) {
        println!(
            "{} pictures, {} of them rendered in {} s",
            self.names.len(),
            self.rendered,
            self.start.elapsed().as_secs()
        );
    }
}

/// Gives a command few samples per pixel, if it does not have fewer.
fn set_samples(words: &mut Vec<String>) {
    let value = words.iter().position(|word| word == "--spp").map(|option| option + 1);
    match value.filter(|&at| at < words.len()) {
        Some(at) if words[at].parse::<u32>().is_ok_and(|spp| spp <= DRAFT_SPP) => {}
        Some(at) => words[at] = DRAFT_SPP.to_string(),
        None => words.extend(["--spp".into(), DRAFT_SPP.to_string()]),
    }
    words.retain(|word| word != "--guiding");
}

/// A number for the words of a command and the contents of the files that they name.
fn key(words: &[String]) -> u64 {
    let mut hasher = DefaultHasher::new();
    words.hash(&mut hasher);
    for word in words {
        if let Ok(content) = std::fs::read(word) {
            content.hash(&mut hasher);
        }
    }
    hasher.finish()
}

/// The words of a command; single quotes group words.
fn words(command: &str) -> Vec<String> {
    let (mut words, mut word, mut is_quoted) = (Vec::new(), String::new(), false);
    for c in command.chars() {
        match c {
            '\'' => is_quoted = !is_quoted,
            ' ' if !is_quoted => {
                if !word.is_empty() {
                    words.push(std::mem::take(&mut word));
                }
            }
            _ => word.push(c),
        }
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_words_stay_together_and_drafts_have_few_samples() {
        let mut words = words("snell render a -D 'b={\"c\": 1}' --spp 256 -o a.jpg");
        assert_eq!(words[4], "b={\"c\": 1}");
        set_samples(&mut words);
        assert_eq!(words[5..7], ["--spp", "8"]);
        assert_ne!(key(&words), key(&words[1..]));
    }
}
