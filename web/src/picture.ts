// The canvas: shows frames, and shows the last one again when only the display settings change.

import type { Frame } from "./connection";
import { unpackHalves } from "./halves";
import { type Display, toDisplay } from "./tonemap";

export class Picture {
  readonly canvas = document.createElement("canvas");
  /** Size of the picture at rest, as the server has it. */
  pictureSize: [number, number] = [0, 0];
  display: Display = { exposure: 0, tonemap: "none", srgb: true };
  private readonly context = this.canvas.getContext("2d", { alpha: false })!;
  /** The picture at rest in linear light; `null` while something moves. */
  linear: { halves: Uint16Array; size: [number, number] } | null = null;

  constructor() {
    this.canvas.className = "picture";
  }

  /** Takes the size of the picture, which another page may have set. */
  private fit(size: [number, number]): void {
    if (size[0] > 0 && size[1] > 0) this.resize(size);
  }

  resize(size: [number, number]): void {
    if (this.canvas.width === size[0] && this.canvas.height === size[1]) return;
    const before = document.createElement("canvas");
    [before.width, before.height] = [this.canvas.width, this.canvas.height];
    before.getContext("2d")!.drawImage(this.canvas, 0, 0);
    [this.canvas.width, this.canvas.height] = size;
    this.context.drawImage(before, 0, 0, size[0], size[1]);
  }

  async show(frame: Frame): Promise<void> {
    if (frame.kind === "jpeg") {
      this.linear = null;
      const bitmap = await createImageBitmap(new Blob([frame.payload], { type: "image/jpeg" }));
      this.fit(this.pictureSize);
      this.context.imageSmoothingQuality = "high";
      this.context.drawImage(bitmap, 0, 0, this.canvas.width, this.canvas.height);
      bitmap.close();
    } else {
      const halves = await unpackHalves(frame.payload, frame.size);
      this.fit(frame.size);
      this.linear = { halves, size: frame.size };
      this.redraw();
    }
    this.canvas.dataset.frame = String(frame.number);
    this.canvas.dataset.samples = String(frame.samples);
    this.canvas.dataset.kind = frame.kind;
    this.canvas.dataset.denoised = String(frame.denoised > 0);
  }

  /** Redraws the picture with the current display settings. */
  redraw(): void {
    if (!this.linear) return;
    const { halves, size } = this.linear;
    const image = new ImageData(size[0], size[1]);
    toDisplay(halves, image.data, this.display);
    if (size[0] === this.canvas.width && size[1] === this.canvas.height) {
      this.context.putImageData(image, 0, 0);
      return;
    }
    const whole = document.createElement("canvas");
    [whole.width, whole.height] = size;
    whole.getContext("2d")!.putImageData(image, 0, 0);
    this.context.drawImage(whole, 0, 0, this.canvas.width, this.canvas.height);
  }
}
