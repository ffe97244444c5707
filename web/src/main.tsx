// The page: the picture, a bar above it, a panel beside it, and numbers below it.

import { useSignal, useSignalEffect } from "@preact/signals";
import { type ComponentChildren, type JSX, render } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { listen, PRESETS, presetDirection } from "./controls";
import { Costs } from "./costs";
import { Explain } from "./explain";
import { Panel } from "./panels";
import {
  busy,
  choices,
  comparing,
  connected,
  costs,
  focusing,
  gallery,
  notices,
  numbers,
  picked,
  pickedPixel,
  Store,
  scene,
  steering,
  steers,
  view,
} from "./store";
import "./style.css";

const socketUrl = new URL("ws", document.baseURI);
socketUrl.protocol = socketUrl.protocol === "https:" ? "wss:" : "ws:";
const store = new Store(socketUrl.href);

const showsHelp = { current: (): void => {} };
const showsPanel = { current: (): void => {} };

function Stage(): JSX.Element {
  const box = useRef<HTMLDivElement>(null);
  const split = useSignal(50);
  useEffect(() => {
    const element = box.current!;
    element.prepend(store.picture.canvas, store.picture.reference);
    const resized = new ResizeObserver(() => {
      store.resize(element.clientWidth * devicePixelRatio, element.clientHeight * devicePixelRatio);
    });
    resized.observe(element);
    const stop = listen(element, store, {
      help: () => showsHelp.current(),
      panel: () => showsPanel.current(),
      compare: () => toggleCompare(),
      undo: () => store.send({ type: "undo" }),
      redo: () => store.send({ type: "redo" }),
      select: (x, y) => {
        if (focusing.value) {
          focusing.value = false;
          void store.focus(x, y, false);
          return;
        }
        pickedPixel.value = [Math.floor(x), Math.floor(y)];
        void store.pick(x, y).then((hit) => (picked.value = hit));
      },
      explain: (x, y) => void store.explain([Math.floor(x), Math.floor(y)]),
    });
    return () => {
      resized.disconnect();
      stop();
    };
  }, []);
  useSignalEffect(() => {
    const { reference } = store.picture;
    reference.style.display = comparing.value ? "block" : "none";
    reference.style.clipPath = `inset(0 ${100 - split.value}% 0 0)`;
  });
  return (
    <div
      class="stage"
      ref={box}
      // biome-ignore lint/a11y/noNoninteractiveTabindex: an application takes keys
      tabIndex={0}
      role="application"
      aria-label={
        "the picture: drag to turn, wheel to come closer, double-click to focus, " +
        "? for all keys"
      }
    >
      {comparing.value && (
        <input
          class="split"
          type="range"
          min="0"
          max="100"
          step="0.1"
          value={split.value}
          aria-label="kept picture on the left, present one on the right"
          onPointerDown={(e) => e.stopPropagation()}
          onInput={(e) => (split.value = Number(e.currentTarget.value))}
        />
      )}
      {busy.value && (
        <p class="busy" role="status">
          {busy.value} …
        </p>
      )}
      {!connected.value && (
        <p class="busy" role="status">
          No connection to the server; trying again …
        </p>
      )}
    </div>
  );
}

function toggleCompare(): void {
  if (!comparing.value) store.picture.keep();
  comparing.value = !comparing.value;
}

async function save(format: string): Promise<void> {
  const response = await fetch(`save?format=${format}`);
  if (!response.ok) {
    store.notice((await response.text()).trim());
    return;
  }
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await response.blob());
  link.download = `${scene.value?.name.replace(/[^A-Za-z0-9]/g, "-") || "picture"}.${format}`;
  link.click();
  URL.revokeObjectURL(link.href);
}

async function copyCommand(): Promise<void> {
  const command = view.value?.command ?? "";
  try {
    await navigator.clipboard.writeText(command);
    store.notice(`Copied: ${command}`);
  } catch {
    store.notice(command);
  }
}

/** A menu of buttons in the bar. It closes when one of them is chosen. */
function Menu(props: { name: string; class?: string; children: ComponentChildren }): JSX.Element {
  const close = (event: JSX.TargetedEvent<HTMLElement>): void => {
    const details = event.currentTarget.closest("details");
    if (details) details.open = false;
  };
  return (
    <details class={`menu ${props.class ?? ""}`}>
      <summary>{props.name}</summary>
      {/* biome-ignore lint/a11y/useKeyWithClickEvents: its buttons have keys */}
      {/* biome-ignore lint/a11y/noStaticElementInteractions: its buttons have keys */}
      <div onClick={close}>{props.children}</div>
    </details>
  );
}

function Bar(): JSX.Element {
  const file = useRef<HTMLInputElement>(null);
  const reference = useRef<HTMLInputElement>(null);
  const history = scene.value?.history ?? [false, false];
  return (
    <header class="bar" role="toolbar" aria-label="scene">
      <strong class="logo">Snell</strong>
      <Menu name={scene.value?.name || "no scene"}>
        <button onClick={() => file.current?.click()}>Open a file …</button>
        <button onClick={() => store.send({ type: "reload" })}>Read again</button>
        <hr />
        <button onClick={() => (gallery.value = true)}>Gallery …</button>
        {choices.value?.scenes.map(({ name }) => (
          <button onClick={() => void store.open(`builtin=${encodeURIComponent(name)}`)}>
            {name}
          </button>
        ))}
      </Menu>
      <input
        ref={file}
        type="file"
        hidden
        aria-label="scene file"
        onChange={(e) => {
          const chosen = e.currentTarget.files?.[0];
          if (chosen) void store.open(`name=${encodeURIComponent(chosen.name)}`, chosen);
          e.currentTarget.value = "";
        }}
      />
      <input
        ref={reference}
        type="file"
        accept="image/*"
        hidden
        aria-label="picture to compare with"
        onChange={(e) => {
          const chosen = e.currentTarget.files?.[0];
          e.currentTarget.value = "";
          if (!chosen) return;
          store.picture.keepFile(chosen).then(
            () => (comparing.value = true),
            () =>
              store.notice(
                `${chosen.name}: the browser cannot read this picture; PNG, JPEG and WebP it can`,
              ),
          );
        }}
      />
      <Menu name="View">
        <button onClick={() => reference.current?.click()}>Compare with a picture …</button>
        <button onClick={() => store.frameAll()}>
          Frame all <kbd>F</kbd>
        </button>
        {PRESETS.map((p) => (
          <button
            onClick={() =>
              store.look(presetDirection(p.direction, store.rig?.worldUp ?? [0, 1, 0]))
            }
          >
            {p.name} <kbd>{p.key}</kbd>
          </button>
        ))}
      </Menu>
      <button
        disabled={!history[0]}
        onClick={() => store.send({ type: "undo" })}
        title="Undo (Ctrl+Z)"
      >
        Undo
      </button>
      <button
        disabled={!history[1]}
        onClick={() => store.send({ type: "redo" })}
        title="Redo (Ctrl+Shift+Z)"
      >
        Redo
      </button>
      <button
        aria-pressed={comparing.value}
        onClick={toggleCompare}
        title="Keep this picture and compare (C)"
      >
        A | B
      </button>
      <span class="space" />
      {!steers.value && (
        <button class="accent" onClick={() => store.send({ type: "steer" })}>
          Take over
        </button>
      )}
      {steering.value.watching > 1 && <span class="quiet">{steering.value.watching} watch</span>}
      <Menu name="Save" class="right">
        <button onClick={() => void save("png")}>PNG, as shown</button>
        <button onClick={() => void save("exr")}>OpenEXR, linear</button>
        <button onClick={() => void copyCommand()}>Copy the command</button>
      </Menu>
      <button onClick={() => showsPanel.current()} title="Panel (P)">
        Panel
      </button>
      <button onClick={() => showsHelp.current()} title="Keys (?)" aria-label="keys">
        ?
      </button>
    </header>
  );
}

/** Scenes to begin with. */
function Gallery(): JSX.Element {
  return (
    <div class="explain gallery" role="dialog" aria-label="scenes to look at">
      <header>
        <h2>Choose a scene, or drop a file</h2>
        <span class="quiet">glb, gltf, ply, obj, stl, off, scn, snell …</span>
        <span class="space" />
        <button onClick={() => (gallery.value = false)}>Close</button>
      </header>
      <div class="cards">
        {choices.value?.scenes.map(({ name, description }) => (
          <button
            class="card"
            aria-label={name}
            onClick={() => void store.open(`builtin=${encodeURIComponent(name)}`)}
          >
            <img
              src={`thumbnail?scene=${encodeURIComponent(name)}`}
              alt=""
              width="288"
              height="180"
              loading="lazy"
            />
            <strong>{name}</strong>
            <small class="quiet">{description}</small>
          </button>
        ))}
      </div>
    </div>
  );
}

function Status(): JSX.Element {
  const n = numbers.value;
  const moving = n.wanted === 0;
  const percent = (x: number): string => `${(x * 100).toPrecision(2)} %`;
  return (
    <footer class="status" role="status" aria-live="off">
      <span class={moving ? "dot moving" : n.samples >= n.wanted ? "dot done" : "dot"} />
      {moving ? (
        <>
          <span>{n.framesPerSecond} frames/s</span>
          <span>{n.latency.toFixed(0)} ms</span>
          <span>scale {percent(n.scale)}</span>
        </>
      ) : (
        <>
          <span data-testid="samples">
            {n.samples} of {n.wanted} samples
          </span>
          {Number.isFinite(n.noise) && <span>noise {percent(n.noise)}</span>}
          <span>{n.seconds.toFixed(1)} s</span>
        </>
      )}
      <span class="space" />
      <span>
        {n.size[0]} × {n.size[1]}
      </span>
      {scene.value && <span>{scene.value.triangles.toLocaleString("en")} triangles</span>}
      {!moving && n.wanted > 0 && (
        <progress max={n.wanted} value={n.samples} aria-label="samples" />
      )}
    </footer>
  );
}

const KEYS: [string, string][] = [
  ["Drag", "turn about the middle"],
  ["Right or Shift + drag", "move sideways"],
  ["Alt + drag", "look around"],
  ["Wheel, + and -", "come closer or go away"],
  ["Double-click", "turn about this point and focus on it"],
  ["Click", "what is here?"],
  ["X", "why does the pixel under the pointer look so?"],
  ["W A S D, Q E", "fly"],
  ["Arrows", "turn"],
  ["F", "see all"],
  ["1 to 6", "front, back, right, left, top, bottom"],
  ["C", "compare with the picture as it is now"],
  ["P", "panel"],
  ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"],
];

function Help(props: { close(): void }): JSX.Element {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  return (
    <dialog ref={dialog} onClose={props.close} aria-label="keys">
      <table>
        <tbody>
          {KEYS.map(([key, what]) => (
            <tr>
              <th>
                <kbd>{key}</kbd>
              </th>
              <td>{what}</td>
            </tr>
          ))}
        </tbody>
      </table>
      <form method="dialog">
        <button>Close</button>
      </form>
    </dialog>
  );
}

function App(): JSX.Element {
  const help = useSignal(false);
  const panel = useSignal(window.innerWidth > 760);
  const dropping = useSignal(false);
  showsHelp.current = () => (help.value = !help.value);
  showsPanel.current = () => (panel.value = !panel.value);
  const drop = (event: DragEvent): void => {
    event.preventDefault();
    dropping.value = false;
    const file = event.dataTransfer?.files[0];
    if (file) void store.open(`name=${encodeURIComponent(file.name)}`, file);
  };
  return (
    <main
      onDragOver={(e) => {
        e.preventDefault();
        dropping.value = true;
      }}
      onDragLeave={(e) => {
        if (e.relatedTarget === null) dropping.value = false;
      }}
      onDrop={drop}
    >
      <Bar />
      <div class="middle">
        <Stage />
        <Explain store={store} />
        {costs.value && <Costs />}
        {gallery.value && <Gallery />}
        {panel.value && <Panel store={store} />}
      </div>
      <Status />
      {help.value && <Help close={() => (help.value = false)} />}
      {dropping.value && <div class="drop">Drop a scene: glb, ply, obj, stl, scn …</div>}
      <div class="notices" role="alert">
        {notices.value.map((n) => (
          <p key={n.id}>
            {n.text}
            <button
              aria-label="dismiss"
              onClick={() => (notices.value = notices.value.filter((m) => m.id !== n.id))}
            >
              ×
            </button>
          </p>
        ))}
      </div>
    </main>
  );
}

render(<App />, document.getElementById("app")!);
