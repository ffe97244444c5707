// The renderer in a worker of the page, in place of a server.

import { signal } from "@preact/signals";
import type { Host, Line } from "../host";
import { copyLink, openAddress } from "./follow";
import { load } from "./load";
import type { FromWorker, Opening, ToWorker } from "./messages";
import { opened } from "./origin";

/** The address of the program, which the build puts here. */
declare const __PROGRAM__: string;

/** What is said until the renderer answers, or after it has stopped. */
const state = signal("Loading the renderer");

/** The program of the renderer, loaded once. */
let program: Promise<ArrayBuffer> | null = null;

/** The worker of now, and what waits for its answers. */
let worker: Worker | null = null;
let lastId = 0;
const waiting = new Map<number, { done(response: Response): void; fail(error: Error): void }>();

/** What the next worker begins with. */
const USUAL = "cornell-box";
const opening: Opening = { scene: USUAL, is_gallery: true, frames_per_second: 30 };

/** Sets the scene that is shown first, and whether others are offered. */
export function beginWith(scene: string | null, isGallery: boolean): void {
  opening.is_gallery = isGallery;
  opening.scene = scene ?? USUAL;
}

function loaded(): Promise<ArrayBuffer> {
  program ??= load(__PROGRAM__, (share) => {
    if (Number.isFinite(share)) state.value = `Loading the renderer: ${Math.round(share * 100)} %`;
  });
  return program;
}

/** The answer to a request, as a server would give it. */
function answered({ status, note, bytes }: FromWorker & { type: "answer" }): Response {
  if (status < 200 || status > 599)
    return new Response("the renderer has not started", { status: 503 });
  const headers: Record<string, string> = note === "" ? {} : { "snell-losses": note };
  return new Response(status === 204 ? null : bytes, { status, headers });
}

function connect(): Line {
  const line: Line & { readyState: number } = {
    send: (text) => post({ type: "message", text }),
    readyState: WebSocket.CONNECTING,
    onopen: null,
    onmessage: null,
    onclose: null,
  };
  const own = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
  worker = own;
  const close = (message: string): void => {
    if (worker !== own) return;
    own.terminate();
    worker = null;
    state.value = `The renderer has stopped: ${message}. It starts again …`;
    // What never ran may have been loaded wrongly.
    if (line.readyState === WebSocket.CONNECTING) program = null;
    line.readyState = WebSocket.CLOSED;
    for (const { fail } of waiting.values()) fail(new Error(message));
    waiting.clear();
    // It would stop again for the same reason.
    opening.scene = USUAL;
    line.onclose?.();
  };
  own.onmessage = ({ data }: MessageEvent<FromWorker>) => {
    if (data.type === "started") {
      line.readyState = WebSocket.OPEN;
      opened(opening.scene);
      line.onopen?.();
    } else if (data.type === "message") line.onmessage?.({ data: data.data });
    else if (data.type === "answer") {
      waiting.get(data.id)?.done(answered(data));
      waiting.delete(data.id);
    } else close(data.message);
  };
  own.onerror = (event) => close(event.message || "its program could not be read");
  loaded().then(
    (bytes) => own.postMessage({ type: "start", program: bytes, opening } satisfies ToWorker),
    (error: Error) => close(error.message),
  );
  return line;
}

function post(message: ToWorker, transfer: Transferable[] = []): void {
  worker?.postMessage(message, transfer);
}

async function ask(asked: string, options?: RequestInit): Promise<Response> {
  const [request, query] = asked.split("?");
  const given = new URLSearchParams(query ?? "");
  const sent = options?.body ?? null;
  const body = sent === null ? null : await new Response(sent).arrayBuffer();
  if (!worker) throw new Error(state.value);
  const id = ++lastId;
  const answer = new Promise<Response>((done, fail) => {
    waiting.set(id, { done, fail });
    const parameters = JSON.stringify(Object.fromEntries(given));
    const transfer = body ? [body] : [];
    post({ type: "ask", id, request: request!, query: parameters, body }, transfer);
  });
  if (request === "open" && (await answer).ok) opened(given.get("builtin"));
  return answer;
}

export const alone: Host = {
  connect,
  ask,
  copyLink,
  openAddress,
  thumbnail: (scene) => `gallery/${encodeURIComponent(scene)}.jpg`,
  get lost() {
    return state.value;
  },
  gone: "",
  silent: "The renderer of this page has stopped; it starts again.",
};
