// The worker: renders in steps, and listens to the page between them.

import type { FromWorker, ToWorker } from "./messages";
import { Program } from "./program";

/** Milliseconds of a step while the user does something, and otherwise. */
const SHORT = 8;
const LONG = 40;
/** For so many milliseconds after a message, the user is believed to do something. */
const LIVELY = 1000;

const page = self as unknown as {
  postMessage(message: FromWorker, transfer?: Transferable[]): void;
};

let program: Program | null = null;
let heard = 0;
let timer = 0;
let isScheduled = false;

// A message to itself comes after those of the page that wait already, and without the delay that
// timers of browsers have.
const alarm = new MessageChannel();
alarm.port1.onmessage = () => {
  isScheduled = false;
  guarded(turn);
};

function soon(): void {
  clearTimeout(timer);
  if (isScheduled) return;
  isScheduled = true;
  alarm.port2.postMessage(null);
}

/** Sends all that the renderer has to say. */
function tell(): void {
  for (let said = program?.next(); said != null; said = program?.next())
    page.postMessage({ type: "message", data: said }, typeof said === "string" ? [] : [said]);
}

/** Renders one step, and notes when the next one is due. */
function turn(): void {
  if (!program) return;
  const isLively = performance.now() - heard < LIVELY;
  const wait = program.step(isLively ? SHORT : LONG);
  tell();
  if (wait === 0) soon();
  else if (wait > 0) timer = self.setTimeout(soon, wait);
}

/** Does something; if the renderer fails in it, says so and stops. */
function guarded(act: () => void): void {
  try {
    act();
  } catch (error) {
    program = null;
    page.postMessage({ type: "failed", message: said(error) });
  }
}

/** What the page tells of a failure. */
function said(error: unknown): string {
  const text = error instanceof Error ? error.message : String(error);
  if (error instanceof RangeError || /memory|allocat/i.test(text))
    return "the memory of the browser does not suffice: open a smaller scene or picture";
  return `a fault in the renderer (${text})`;
}

async function start(message: ToWorker & { type: "start" }): Promise<void> {
  try {
    const fresh = await Program.of(message.program);
    const problem = fresh.start(message.opening);
    if (problem !== null) throw new Error(problem);
    program = fresh;
  } catch (error) {
    page.postMessage({ type: "failed", message: said(error) });
    return;
  }
  page.postMessage({ type: "started" });
  guarded(turn);
}

self.onmessage = ({ data }: MessageEvent<ToWorker>) => {
  heard = performance.now();
  if (data.type === "start") {
    void start(data);
    return;
  }
  guarded(() => {
    if (!program) return;
    if (data.type === "message") program.receive(data.text);
    else {
      const answer = program.ask(data.request, data.query, data.body);
      // What follows from the request is told before its answer.
      tell();
      page.postMessage({ type: "answer", id: data.id, ...answer }, [answer.bytes]);
    }
    soon();
  });
};
