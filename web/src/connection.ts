// The WebSocket: messages become objects, binary messages frames. A broken connection is opened
// again.

import { HEADER_SIZE, type ToPage, type ToServer } from "./protocol.gen";

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
  payload: ArrayBuffer;
}

/** Reads a binary message; `null` if it is none of ours. */
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
    payload: buffer.slice(HEADER_SIZE),
  };
}

export interface Listener {
  message(message: ToPage): void;
  /** Resolves when the frame has been shown; only then comes the next but one. */
  frame(frame: Frame): Promise<void>;
  status(connected: boolean): void;
}

/** Milliseconds until the first new try, and the longest wait. */
const FIRST_RETRY = 300;
const LAST_RETRY = 5000;

export class Connection {
  private socket: WebSocket | null = null;
  private retry = FIRST_RETRY;
  /** The frames so far have been shown. */
  private shown: Promise<void> = Promise.resolve();

  constructor(
    private readonly url: string,
    private readonly listener: Listener,
  ) {
    this.open();
  }

  get isOpen(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  send(message: ToServer): void {
    if (this.isOpen) this.socket!.send(JSON.stringify(message));
  }

  private open(): void {
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.retry = FIRST_RETRY;
      this.listener.status(true);
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = () => {
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
    const frame = parseFrame(data);
    if (!frame) return;
    // Frames are shown one after another: a picture that takes longer to decode must not cover a
    // later one.
    this.shown = this.shown
      .then(() => this.listener.frame(frame))
      .catch(reportError)
      .then(() => this.send({ type: "ack", frame: frame.number }));
  }
}
