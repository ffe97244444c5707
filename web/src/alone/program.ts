// The renderer: its functions, and bytes that are passed to and from its memory.

import {
  ConsoleStdout,
  Directory,
  File,
  OpenFile,
  PreopenDirectory,
  WASI,
} from "@bjorn3/browser_wasi_shim";

/** What crates/wasm exports. */
interface Exports {
  memory: WebAssembly.Memory;
  snell_allocate(length: number): number;
  snell_out(): number;
  snell_out_length(): number;
  snell_start(start: number, length: number): number;
  snell_receive(start: number, length: number): void;
  snell_ask(start: number, length: number): number;
  snell_step(milliseconds: number): number;
  snell_next(): number;
  [name: string]: unknown;
}

const encoder = new TextEncoder();
const decoder = new TextDecoder();

export interface Answer {
  status: number;
  note: string;
  bytes: ArrayBuffer;
}

export class Program {
  private constructor(private readonly exports: Exports) {}

  /** Makes the renderer of a module, with an empty folder for files. */
  static async of(module: ArrayBuffer): Promise<Program> {
    const tell = ConsoleStdout.lineBuffered((line) => console.warn(line));
    const root = new PreopenDirectory("/", new Map([["tmp", new Directory(new Map())]]));
    const files = [new OpenFile(new File([])), tell, tell, root];
    const wasi = new WASI(["snell"], [], files, { debug: false });
    const imports = { wasi_snapshot_preview1: wasi.wasiImport };
    const { instance } = await WebAssembly.instantiate(module, imports as WebAssembly.Imports);
    const exports = instance.exports as unknown as Exports;
    wasi.initialize({ exports });
    return new Program(exports);
  }

  /** Writes bytes into the memory of the renderer, which owns them then. */
  private give(...parts: Uint8Array[]): [number, number] {
    const length = parts.reduce((sum, part) => sum + part.length, 0);
    // Addresses above 2 GB come as negative numbers.
    const start = this.exports.snell_allocate(length) >>> 0;
    let at = start;
    for (const part of parts) {
      new Uint8Array(this.exports.memory.buffer).set(part, at);
      at += part.length;
    }
    return [start, length];
  }

  /** A copy of what the last function returned. */
  private taken(): ArrayBuffer {
    const start = this.exports.snell_out() >>> 0;
    const length = this.exports.snell_out_length() >>> 0;
    return this.exports.memory.buffer.slice(start, start + length) as ArrayBuffer;
  }

  /** Opens a scene; a message for the user if that fails. */
  start(opening: object): string | null {
    const began = this.exports.snell_start(...this.give(encoder.encode(JSON.stringify(opening))));
    return began === 1 ? null : decoder.decode(this.taken());
  }

  receive(text: string): void {
    this.exports.snell_receive(...this.give(encoder.encode(text)));
  }

  ask(request: string, query: string, body: ArrayBuffer | null): Answer {
    const head = encoder.encode(`${request}\n${query}\n`);
    const status = this.exports.snell_ask(
      ...this.give(head, new Uint8Array(body ?? new ArrayBuffer(0))),
    );
    const answer = this.taken();
    const note = new DataView(answer).getUint32(0, true);
    return {
      status,
      note: decoder.decode(new Uint8Array(answer, 4, note)),
      bytes: answer.slice(4 + note),
    };
  }

  /** Renders for about so long; for how many milliseconds nothing is to be done, or negative. */
  step(milliseconds: number): number {
    return this.exports.snell_step(milliseconds);
  }

  /** What the renderer says next. */
  next(): string | ArrayBuffer | null {
    const kind = this.exports.snell_next();
    if (kind === 0) return null;
    const bytes = this.taken();
    return kind === 1 ? decoder.decode(bytes) : bytes;
  }
}
