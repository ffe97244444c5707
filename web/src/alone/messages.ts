// Messages between the page and the worker that renders for it.

/** What the renderer begins with: `Opening` of crates/wasm. */
export interface Opening {
  scene: string;
  is_gallery: boolean;
  frames_per_second: number;
}

export type ToWorker =
  | { type: "start"; program: ArrayBuffer; opening: Opening }
  /** A message of the viewer's protocol. */
  | { type: "message"; text: string }
  /** A request, such as `save`, with its parameters. */
  | { type: "ask"; id: number; request: string; query: string; body: ArrayBuffer | null };

export type FromWorker =
  | { type: "started" }
  /** A text or a frame of the viewer's protocol. */
  | { type: "message"; data: string | ArrayBuffer }
  | { type: "answer"; id: number; status: number; note: string; bytes: ArrayBuffer }
  /** The renderer has stopped; why. */
  | { type: "failed"; message: string };
