//! Animated pictures: a sequence of frames of display values. APNG keeps every colour; GIF has 256
//! colours per frame. Animations of both formats loop. Y4M is raw video, from which `ffmpeg` and
//! other programs read size and rate.

use std::io::Write;

/// A format for animated pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnimatedFormat {
    /// Animated PNG.
    Apng,
    /// GIF.
    Gif,
    /// YUV4MPEG2, without subsampling.
    Y4m,
}

impl AnimatedFormat {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Apng, Self::Gif, Self::Y4m];

    /// The extension of the format's files, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Apng => "apng",
            Self::Gif => "gif",
            Self::Y4m => "y4m",
        }
    }

    /// The format with this extension, in any case.
    pub fn of_extension(extension: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.extension().eq_ignore_ascii_case(extension))
    }
}

/// Writes an animated picture frame by frame.
pub struct AnimatedWriter<W: Write> {
    size: [u32; 2],
    /// Frames per second.
    rate: f64,
    written: u32,
    encoder: Encoder<W>,
}

enum Encoder<W: Write> {
    Apng { writer: Box<::png::Writer<W>>, has_alpha: bool },
    Gif(Box<gif::Encoder<W>>),
    Y4m(W),
}

impl<W: Write> AnimatedWriter<W> {
    /// Begins an animated picture of `count` frames at `rate` frames per second. `first` is a PNG
    /// file that sets the size; if it is opaque, all frames are.
    pub fn new(
        format: AnimatedFormat,
        mut out: W,
        first: &[u8],
        rate: f64,
        count: u32,
    ) -> Result<Self, String> {
        let image = decode(first)?;
        let size = [image.width(), image.height()];
        let encoder = match format {
            AnimatedFormat::Apng => {
                let has_alpha = image.pixels().any(|p| p[3] < 255);
                let mut encoder = ::png::Encoder::new(out, size[0], size[1]);
                encoder.set_color(if has_alpha {
                    ::png::ColorType::Rgba
                } else {
                    ::png::ColorType::Rgb
                });
                encoder.set_depth(::png::BitDepth::Eight);
                encoder.set_animated(count.max(1), 0).map_err(text)?;
                let (numerator, denominator) = delay(rate);
                encoder.set_frame_delay(numerator, denominator).map_err(text)?;
                Encoder::Apng { writer: Box::new(encoder.write_header().map_err(text)?), has_alpha }
            }
            AnimatedFormat::Gif => {
                let [w, h] = size.map(u16::try_from);
                let (Ok(w), Ok(h)) = (w, h) else {
                    return Err("GIF holds at most 65535 pixels a side".into());
                };
                let mut encoder = gif::Encoder::new(out, w, h, &[]).map_err(text)?;
                encoder.set_repeat(gif::Repeat::Infinite).map_err(text)?;
                Encoder::Gif(Box::new(encoder))
            }
            AnimatedFormat::Y4m => {
                let (seconds, frames) = delay(rate);
                let [w, h] = size;
                writeln!(out, "YUV4MPEG2 W{w} H{h} F{frames}:{seconds} Ip A1:1 C444")
                    .map_err(text)?;
                Encoder::Y4m(out)
            }
        };
        Ok(Self { size, rate, written: 0, encoder })
    }

    /// Adds a frame: a PNG file of 8 bits per channel.
    pub fn add(&mut self, png: &[u8]) -> Result<(), String> {
        let mut image = decode(png)?;
        if [image.width(), image.height()] != self.size {
            return Err("the frames differ in size".into());
        }
        let number = f64::from(self.written);
        self.written += 1;
        match &mut self.encoder {
            Encoder::Apng { writer, has_alpha: true } => {
                writer.write_image_data(&image).map_err(text)
            }
            Encoder::Apng { writer, has_alpha: false } => {
                let rgb: Vec<u8> = image.pixels().flat_map(|p| [p[0], p[1], p[2]]).collect();
                writer.write_image_data(&rgb).map_err(text)
            }
            Encoder::Gif(encoder) => {
                let [w, h] = self.size.map(|side| side as u16);
                // Speed of the GIF encoder, from 1 (slowest, best colours) to 30.
                const SPEED: i32 = 10;
                let mut frame = gif::Frame::from_rgba_speed(w, h, &mut image, SPEED);
                // Delays are in hundredths of a second, rounded so that the total duration is
                // right.
                let end = |frames: f64| (frames * 100.0 / self.rate).round();
                frame.delay = (end(number + 1.0) - end(number)).clamp(1.0, 65535.0) as u16;
                frame.dispose = gif::DisposalMethod::Background;
                encoder.write_frame(&frame).map_err(text)
            }
            Encoder::Y4m(out) => {
                let planes = yuv(&image);
                out.write_all(b"FRAME\n").and_then(|()| out.write_all(&planes)).map_err(text)
            }
        }
    }

    /// Writes the end of the file.
    pub fn finish(self) -> Result<(), String> {
        match self.encoder {
            Encoder::Apng { writer, .. } => writer.finish().map_err(text),
            Encoder::Gif(encoder) => encoder.into_inner().map_err(text)?.flush().map_err(text),
            Encoder::Y4m(mut out) => out.flush().map_err(text),
        }
    }
}

fn decode(png: &[u8]) -> Result<::image::RgbaImage, String> {
    let image = ::image::load_from_memory_with_format(png, ::image::ImageFormat::Png);
    image.map(|image| image.to_rgba8()).map_err(text)
}

/// The duration of a frame in seconds, as numerator and denominator.
fn delay(rate: f64) -> (u16, u16) {
    if rate.fract() == 0.0 && (1.0..=65535.0).contains(&rate) {
        return (1, rate as u16);
    }
    // The denominator: 1001 for the rates of television (24000/1001 ...), otherwise 1000 or a
    // divisor that is close enough.
    let near = |n: f64| ((rate * n).round() / n - rate).abs() < 1e-4 && rate * n <= 65535.0;
    let numerator = [1001.0, 1000.0, 100.0, 10.0].into_iter().find(|&n| near(n)).unwrap_or(1.0);
    (numerator as u16, (rate * numerator).round().clamp(1.0, 65535.0) as u16)
}

/// Planes of luma and chroma in video range. Transparent pixels are composited over black. The
/// matrix is what players assume: BT.709 for pictures of 720 rows and more, BT.601 for smaller
/// ones.
fn yuv(image: &::image::RgbaImage) -> Vec<u8> {
    let [kr, kb] = if image.height() >= 720 { [0.2126f32, 0.0722] } else { [0.299, 0.114] };
    let count = image.width() as usize * image.height() as usize;
    let mut planes = vec![0; 3 * count];
    for (i, pixel) in image.pixels().enumerate() {
        let alpha = f32::from(pixel[3]) / 255.0;
        let [r, g, b] = [0, 1, 2].map(|c| f32::from(pixel[c]) / 255.0 * alpha);
        let y = kr * r + (1.0 - kr - kb) * g + kb * b;
        let (u, v) = ((b - y) / (2.0 * (1.0 - kb)), (r - y) / (2.0 * (1.0 - kr)));
        planes[i] = (16.0 + 219.0 * y).round() as u8;
        planes[count + i] = (128.0 + 224.0 * u).round() as u8;
        planes[2 * count + i] = (128.0 + 224.0 * v).round() as u8;
    }
    planes
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(color: [u8; 4]) -> Vec<u8> {
        let image = ::image::RgbaImage::from_pixel(6, 4, ::image::Rgba(color));
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, ::image::ImageFormat::Png).expect("PNG is known");
        bytes.into_inner()
    }

    fn animated(format: AnimatedFormat, frames: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut writer =
            AnimatedWriter::new(format, &mut bytes, &frames[0], 24.0, frames.len() as u32)
                .expect("begins");
        frames.iter().for_each(|frame| writer.add(frame).expect("all frames have one size"));
        writer.finish().expect("ends");
        bytes
    }

    #[test]
    fn frames_come_back_in_order() {
        let colors = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]];
        let frames: Vec<Vec<u8>> = colors.iter().map(|&c| png(c)).collect();

        let bytes = animated(AnimatedFormat::Apng, &frames);
        let mut reader = ::png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("PNG");
        let control = reader.info().animation_control.expect("animated");
        assert_eq!((control.num_frames, control.num_plays), (3, 0));
        let mut buffer = vec![0; 6 * 4 * 3];
        for color in colors {
            reader.next_frame(&mut buffer).expect("a frame");
            assert_eq!(buffer[..3], color[..3]);
            let control = reader.info().frame_control.expect("a frame's time");
            assert_eq!((control.delay_num, control.delay_den), (1, 24));
        }

        let bytes = animated(AnimatedFormat::Gif, &frames);
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut reader = options.read_info(&*bytes).expect("GIF");
        let mut delays = Vec::new();
        for color in colors {
            let frame = reader.read_next_frame().expect("sound").expect("a frame");
            assert_eq!(frame.buffer[..4], color);
            delays.push(frame.delay);
        }
        assert_eq!(delays, [4, 4, 5], "an eighth of a second in all");

        let bytes = animated(AnimatedFormat::Y4m, &frames);
        let header = b"YUV4MPEG2 W6 H4 F24:1 Ip A1:1 C444\n";
        assert!(bytes.starts_with(header) && bytes.len() == header.len() + 3 * (6 + 3 * 24));
        let first = &bytes[header.len() + 6..];
        assert_eq!([first[0], first[24], first[48]], [81, 90, 240], "red by BT.601");
    }

    #[test]
    fn rates_are_fractions_and_sizes_must_agree() {
        assert_eq!(
            (delay(24.0), delay(24000.0 / 1001.0), delay(12.5)),
            ((1, 24), (1001, 24000), (1000, 12500))
        );
        let mut writer =
            AnimatedWriter::new(AnimatedFormat::Gif, Vec::new(), &png([0; 4]), 10.0, 2)
                .expect("begins");
        let larger = ::image::RgbaImage::new(7, 4);
        let mut bytes = std::io::Cursor::new(Vec::new());
        larger.write_to(&mut bytes, ::image::ImageFormat::Png).expect("PNG is known");
        assert!(writer.add(bytes.get_ref()).is_err() && writer.add(b"nothing").is_err());
    }
}
