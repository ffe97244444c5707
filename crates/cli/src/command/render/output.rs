//! Writes a film to a file.

use super::options::Options;
use super::summary::Facts;
use super::{frames, preview, rescue};
use crate::failure::Failure;
use crate::standard_output;
use sha2::{Digest, Sha256};
use snell_formats::image::{self, WriteOptions};
use snell_scene::{Layer, LayeredImage};
use std::ffi::OsStr;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// The destination and format of the picture.
pub struct Output<'a> {
    options: &'a Options,
}

/// True if two names mean the same file, which need not exist.
fn is_same_place(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        let folder =
            path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        Some((folder.canonicalize().ok()?, path.file_name()?.to_owned()))
    };
    a == b || place(a).is_some_and(|a| place(b) == Some(a))
}

impl<'a> Output<'a> {
    /// Checks before anything is rendered that the picture can be written: the format must be
    /// known, the folder must exist and be writable.
    pub fn plan(options: &'a Options) -> Result<Self, Failure> {
        if let Some(path) = options.output.as_deref().filter(|p| *p != Path::new("-")) {
            if !options.has_frames() || frames::animated_format(path).is_none() {
                image::check_writable(path)?;
            }
            check_place(path)?;
        }
        if let Some(path) = &options.stats {
            check_place(path)?;
        }
        if let Some(path) = &options.preview {
            image::check_writable(path)?;
            check_place(path)?;
        }
        if options.bits != 8 && options.bits != 16 {
            return Err(Failure::Usage(format!(
                "--bits {}: PNG has 8 or 16 bits per channel",
                options.bits
            )));
        }
        Ok(Self { options })
    }

    /// The path of the picture, or its substitute name if it goes to standard output.
    pub fn path(&self, stem: &OsStr) -> PathBuf {
        match &self.options.output {
            Some(path) if path != Path::new("-") => path.clone(),
            _ => [stem, OsStr::new(".png")].into_iter().collect::<std::ffi::OsString>().into(),
        }
    }

    /// True if the picture goes to standard output.
    pub fn is_standard(&self) -> bool {
        self.options.output.as_deref() == Some(Path::new("-"))
    }

    /// Checks that the picture does not replace another file that the command reads or writes.
    pub fn check_apart(&self, target: &Path) -> Result<(), Failure> {
        if self.is_standard() {
            return Ok(());
        }
        let files = [
            ("--stats", self.options.stats.as_deref()),
            ("--preview", self.options.preview.as_deref()),
            ("--environment", self.options.environment.as_deref().map(Path::new)),
            ("the scene", Some(&*self.options.scene)),
        ];
        for (what, file) in files {
            let Some(file) = file.filter(|file| is_same_place(file, target)) else { continue };
            let (file, remedy) = (file.display(), "give one of them another name");
            return Err(Failure::Usage(format!(
                "{what} {file}: the picture would be written there too; {remedy}"
            )));
        }
        Ok(())
    }

    /// Writes the picture to a file, or to standard output.
    pub fn write(
        &self,
        target: Target,
        picture: LayeredImage,
        facts: &Facts,
    ) -> Result<Written, Failure> {
        let (picture, writing) = prepared(self.options, picture, facts)?;
        let path = target.path();
        let encoded = match target {
            Target::File(path) => image::encode_image(path, &picture, &writing),
            Target::Output { .. } => image::encode_image_as("png", &picture, &writing),
        };
        let bytes = match encoded {
            Ok(bytes) => bytes,
            Err(unfit) => {
                // The file is OpenEXR, which holds any picture.
                let bytes = image::encode_image_as("exr", &picture, &writing)?;
                let is_saved = rescue::elsewhere(
                    &path.with_extension("exr"),
                    "the picture",
                    &unfit.to_string(),
                    &|out| out.write_all(&bytes),
                );
                return if is_saved {
                    Ok(Written { is_in_place: false, sha256: hex(&bytes) })
                } else {
                    Err(unfit.into())
                };
            }
        };
        let fill = |out: &mut dyn Write| out.write_all(&bytes);
        let is_in_place = match target {
            Target::File(path) => rescue::write(path, "the picture", &fill)?,
            Target::Output { .. } => match standard_output::write(&bytes) {
                Ok(()) => true,
                Err(failure)
                    if rescue::elsewhere(path, "the picture", &failure.to_string(), &fill) =>
                {
                    false
                }
                Err(failure) => return Err(failure),
            },
        };
        Ok(Written { is_in_place, sha256: hex(&bytes) })
    }
}

/// The picture as it is written, with the variance if it is asked for and with its metadata, and
/// the way to write it.
pub fn prepared(
    options: &Options,
    mut picture: LayeredImage,
    facts: &Facts,
) -> Result<(LayeredImage, WriteOptions), Failure> {
    if options.variance {
        // Here, the light groups already have unique names.
        let names: Vec<String> = picture.layers.iter().map(|l| l.name.clone()).collect();
        let layers = facts.film.variance().layers.into_iter().zip(names).map(|(layer, name)| {
            let name = if name.is_empty() { "variance".into() } else { format!("{name}.variance") };
            Layer { name, ..layer }
        });
        picture.layers.extend(layers);
    }
    picture.metadata.splice(0..0, facts.metadata());
    let integrator = Some(facts.settings.integrator);
    let tonemap = options.tonemap(facts.scene)?;
    let writing = WriteOptions {
        display: preview::display(options, facts.scene, tonemap, integrator),
        png_bits: if options.has_frames() && frames::is_animated(options) {
            8
        } else {
            options.bits
        },
        exr_half: options.half,
        ..WriteOptions::default()
    };
    Ok((picture, writing))
}

/// The destination of a picture.
#[derive(Clone, Copy, Debug)]
pub enum Target<'a> {
    /// The picture goes to a file.
    File(&'a Path),
    /// Standard output, with a fallback file in the current folder if it cannot be written to.
    Output {
        /// The name of the fallback file.
        stand_in: &'a Path,
    },
}

impl<'a> Target<'a> {
    /// The file, or the fallback for standard output.
    pub fn path(self) -> &'a Path {
        match self {
            Self::File(path) | Self::Output { stand_in: path } => path,
        }
    }
}

/// A picture that was written.
#[derive(Debug)]
pub struct Written {
    /// False if the picture is in a fallback place, see [`rescue`].
    pub is_in_place: bool,
    /// SHA-256 of the file.
    pub sha256: String,
}

/// Writes a text that belongs to the picture, such as its statistics; true if it was written to
/// `path`, false if to a fallback place.
pub fn write_text(path: &Path, what: &str, text: &str) -> Result<bool, Failure> {
    rescue::write(path, what, &|out| out.write_all(text.as_bytes()))
}

/// Checks that a file can be created at a path.
pub fn check_place(path: &Path) -> Result<(), Failure> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (shown, folder_shown) = (path.display(), folder.display());
    if !folder.is_dir() {
        return Err(Failure::Other(format!(
            "{shown}: the folder {folder_shown} does not exist; create it first"
        )));
    }
    if path.is_dir() {
        return Err(Failure::Other(format!("{shown}: this is a folder; name a file in it")));
    }
    Ok(snell_formats::atomic::check(path)?)
}

/// SHA-256 of the content of a file.
pub fn hex(content: &[u8]) -> String {
    text(&Sha256::digest(content))
}

/// SHA-256 of a file.
pub fn sha256_of_file(path: &Path) -> std::io::Result<String> {
    let (mut file, mut hasher) = (std::fs::File::open(path)?, Sha256::new());
    let mut bytes = vec![0; 1 << 20];
    loop {
        match file.read(&mut bytes)? {
            0 => return Ok(text(&hasher.finalize())),
            count => hasher.update(&bytes[..count]),
        }
    }
}

fn text(hash: &[u8]) -> String {
    hash.iter().map(|b| format!("{b:02x}")).collect()
}
