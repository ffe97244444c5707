// The line to the host: messages become objects, binary messages parts of frames. A broken
// connection is opened again.

import type { Line } from "./host";
import { HEADER_SIZE, PART_SIZE, type ToPage, type ToServer } from "./protocol.gen";

export interface Frame {
  kind: "jpeg" | "half";
  number: number;
  seq: number;
  generation: number;
  size: [number, number];
  samples: number;
  wanted: number;
  milliseconds: number;
  noise: number;
  /** Share of a denoised picture in what is shown; 0 for the true samples. */
  denoised: number;
  payload: ArrayBuffer;
}

/** Joins the parts of frames. */
export class Parts {
  private number = -1;
  private bytes = new Uint8Array(0);
  private length = 0;

  /** Takes a message; gives its frame's number, and the frame if this was the last part. */
  add(message: ArrayBuffer): { number: number; whole: ArrayBuffer | null } | null {
    if (message.byteLength < PART_SIZE) return null;
    const view = new DataView(message);
    const [number, offset, total] = [0, 4, 8].map((at) => view.getUint32(at, true));
    if (offset === 0) {
      this.number = number;
      this.bytes = new Uint8Array(total);
      this.length = 0;
    }
    const part = new Uint8Array(message, PART_SIZE);
    const fits = offset === this.length && offset + part.length <= this.bytes.length;
    if (number !== this.number || !fits) return { number, whole: null };
    this.bytes.set(part, offset);
    this.length += part.length;
    return { number, whole: this.length === this.bytes.length ? this.bytes.buffer : null };
  }
}

/** Reads a frame; `null` if it is none of ours. */
export function parseFrame(buffer: ArrayBuffer): Frame | null {
  if (buffer.byteLength < HEADER_SIZE) return null;
  const view = new DataView(buffer);
  const word = (i: number): number => view.getUint32(i * 4, true);
  const kind = word(0);
  if (kind > 1) return null;
  return {
    kind: kind === 0 ? "jpeg" : "half",
    number: word(1),
    seq: word(2),
    generation: word(3),
    size: [word(4), word(5)],
    samples: word(6),
    wanted: word(7),
    milliseconds: view.getFloat32(32, true),
    noise: view.getFloat32(36, true),
    denoised: view.getFloat32(40, true),
    payload: buffer.slice(HEADER_SIZE),
  };
}

export interface Listener {
  message(message: ToPage): void;
  /** Resolves when the frame has been shown; then it is acknowledged. */
  frame(frame: Frame): Promise<void>;
  status(connected: boolean): void;
}

/** Milliseconds until the first new try, and the longest wait. */
const FIRST_RETRY = 300;
const LAST_RETRY = 5000;

export class Connection {
  private line: Line | null = null;
  private retry = FIRST_RETRY;
  /** The frames so far have been shown. */
  private shown: Promise<void> = Promise.resolve();
  private parts = new Parts();

  constructor(
    private readonly connect: () => Line,
    private readonly listener: Listener,
  ) {
    this.open();
  }

  get isOpen(): boolean {
    return this.line?.readyState === WebSocket.OPEN;
  }

  send(message: ToServer): void {
    if (this.isOpen) this.line!.send(JSON.stringify(message));
  }

  private open(): void {
    const line = this.connect();
    this.line = line;
    this.parts = new Parts();
    line.onopen = () => {
      this.retry = FIRST_RETRY;
      this.listener.status(true);
    };
    line.onmessage = (event) => this.receive(event.data);
    line.onclose = () => {
      this.listener.status(false);
      window.setTimeout(() => this.open(), this.retry);
      this.retry = Math.min(this.retry * 2, LAST_RETRY);
    };
  }

  private receive(data: string | ArrayBuffer): void {
    if (typeof data === "string") {
      this.listener.message(JSON.parse(data) as ToPage);
      return;
    }
    const part = this.parts.add(data);
    if (!part) return;
    const acknowledge = (): void => this.send({ type: "ack", frame: part.number });
    const frame = part.whole && parseFrame(part.whole);
    if (!frame) {
      acknowledge();
      return;
    }
    // Frames are shown one after another: a picture that takes longer to decode must not cover a
    // later one.
    this.shown = this.shown
      .then(() => this.listener.frame(frame))
      .catch(reportError)
      .then(acknowledge);
  }
}
