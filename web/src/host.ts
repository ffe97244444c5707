// What renders for the page: the server of `snell view`, or the renderer in a worker of the page.

import type { Store } from "./store";

/** Messages in both directions, as of a WebSocket. */
export interface Line {
  send(text: string): void;
  readonly readyState: number;
  onopen: (() => void) | null;
  onmessage: ((event: { data: string | ArrayBuffer }) => void) | null;
  onclose: (() => void) | null;
}

export interface Host {
  connect(): Line;
  /** Answers a request such as `save?format=png`. */
  ask(request: string, options?: RequestInit): Promise<Response>;
  /** The address of the small picture of a built-in scene. */
  thumbnail(scene: string): string;
  /** Copies a link to what is shown, if the host has links. */
  copyLink?(store: Store): Promise<void>;
  /** Opens the scene at an address of the web, if the host can; false if that fails. */
  openAddress?(store: Store, address: string): Promise<boolean>;
  /** What is said of a host that is gone, and of one that does not answer. */
  readonly lost: string;
  readonly gone: string;
  readonly silent: string;
}

/** The server that the page came from. */
const server: Host = {
  connect() {
    const url = new URL("ws", document.baseURI);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(url.href);
    socket.binaryType = "arraybuffer";
    return socket as Line;
  },
  ask: (request, options) => fetch(request, options),
  thumbnail: (scene) => `thumbnail?scene=${encodeURIComponent(scene)}`,
  lost: "No connection to the server; trying again …",
  gone: "It may have ended: start `snell view` again.",
  silent: "The server does not answer: is `snell view` still running?",
};

export let host: Host = server;

/** Replaces the server, before anything is asked of it. */
export function replaceHost(other: Host): void {
  host = other;
}
