// The bar above the picture.

import type { JSX } from "preact";
import { useRef } from "preact/hooks";
import { reference, toggleCompare } from "./compare/state";
import { PRESETS, presetDirection } from "./controls";
import { host } from "./host";
import { Menu } from "./menu";
import { copyCommand, save } from "./save";
import { saveScene } from "./scenefile";
import { openFiles } from "./send";
import type { Elsewhere } from "./stage";
import { choices, gallery, picked, rig, type Store, scene, steering, steers, view } from "./store";
import { Tools } from "./tools";

/** Undo and redo are arrows where the bar is narrow. */
function Step(props: {
  name: string;
  sign: string;
  keys: string;
  can: boolean;
  act(): void;
}): JSX.Element {
  return (
    <button
      disabled={!props.can}
      onClick={() => props.act()}
      aria-label={props.name}
      title={`${props.name} (${props.keys})`}
    >
      <span class="wide">{props.name}</span>
      <span class="slim" aria-hidden="true">
        {props.sign}
      </span>
    </button>
  );
}

/** The pages that only watch. */
function Watchers(): JSX.Element | null {
  const { client, watching } = steering.value;
  const others = watching - (client === 0 ? 0 : 1);
  if (watching < 2) return null;
  return (
    <span class="quiet" title={`${watching} pages show this scene`}>
      {others} {others === 1 ? "watches" : "watch"}
    </span>
  );
}

export function Bar({ store, elsewhere }: { store: Store; elsewhere: Elsewhere }): JSX.Element {
  const file = useRef<HTMLInputElement>(null);
  const history = view.value?.history ?? [false, false];
  const cameras = scene.value?.cameras ?? [];
  const isParallel = rig.value?.camera.projection.projection === "orthographic";
  return (
    <div class="bar" role="toolbar" aria-label="scene">
      <h1 class="logo">Snell</h1>
      <Menu name={scene.value?.name || "no scene"}>
        <button disabled={!steers.value} onClick={() => file.current?.click()}>
          Open a file …
        </button>
        <button disabled={!steers.value} onClick={() => store.send({ type: "reload" })}>
          Read again
        </button>
        <hr />
        <button onClick={() => (gallery.value = true)}>Gallery …</button>
        {choices.value?.scenes.map(({ name }) => (
          <button
            disabled={!steers.value}
            onClick={() => void store.open(`builtin=${encodeURIComponent(name)}`)}
          >
            {name}
          </button>
        ))}
      </Menu>
      <input
        ref={file}
        type="file"
        multiple
        hidden
        aria-label="scene file"
        onChange={(e) => {
          const chosen = [...(e.currentTarget.files ?? [])];
          void openFiles(
            store,
            chosen.map((file) => ({ path: file.name, file })),
          );
          e.currentTarget.value = "";
        }}
      />
      <Menu name="View">
        <button onClick={() => void toggleCompare(store)}>
          Compare with this picture <kbd>C</kbd>
        </button>
        <hr />
        <button onClick={() => store.home()}>
          Reset camera <kbd>0</kbd>
        </button>
        <button onClick={() => store.frame()}>
          Frame {picked.value ? "selected" : "subject"} <kbd>F</kbd>
        </button>
        <button onClick={() => store.frameAll()}>
          Frame all <kbd>Home</kbd>
        </button>
        <button aria-pressed={isParallel} onClick={() => store.toggleParallel()}>
          Orthographic <kbd>O</kbd>
        </button>
        {cameras.length > 1 && <hr />}
        {cameras.length > 1 &&
          cameras.map((camera, i) => (
            <button onClick={() => store.useCamera(i)}>{camera.name || `Camera ${i + 1}`}</button>
          ))}
        <hr />
        {PRESETS.map((p) => (
          <button
            onClick={() =>
              store.look(presetDirection(p.direction, store.rig?.worldUp ?? [0, 1, 0]))
            }
          >
            {p.name} <kbd>{p.key}</kbd>
          </button>
        ))}
        <hr />
        <button onClick={() => elsewhere.help()}>
          Keys … <kbd>?</kbd>
        </button>
      </Menu>
      <Tools store={store} />
      <Step
        name="Undo"
        sign="↶"
        keys="Ctrl+Z"
        can={history[0] && steers.value}
        act={() => store.undo()}
      />
      <Step
        name="Redo"
        sign="↷"
        keys="Ctrl+Shift+Z"
        can={history[1] && steers.value}
        act={() => store.redo()}
      />
      <button
        class="wide"
        aria-pressed={reference.value !== null}
        onClick={() => void toggleCompare(store)}
        title="Keep this picture and compare (C)"
      >
        A | B
      </button>
      <span class="space" />
      {!steers.value && (
        <button class="accent" onClick={() => store.takeOver()}>
          Take over
        </button>
      )}
      <Watchers />
      <Menu name="Save" class="right">
        <button onClick={() => void save(store, "png")}>PNG, as shown</button>
        <button onClick={() => void save(store, "exr")}>OpenEXR, linear</button>
        <button onClick={() => void copyCommand(store)}>Copy the command</button>
        {host.copyLink && (
          <button onClick={() => void host.copyLink?.(store)}>Copy the link</button>
        )}
        <hr />
        <button onClick={() => void saveScene(store, "snell")}>Scene, all of it (.snell)</button>
        <button onClick={() => void saveScene(store, "glb")}>Scene as glTF (.glb)</button>
      </Menu>
      <button
        class="panel-button"
        onClick={() => elsewhere.panel()}
        aria-label="Panel"
        title="Panel (P)"
      >
        <span class="wide">Panel</span>
        <span class="slim" aria-hidden="true">
          ☰
        </span>
      </button>
      <button class="wide" onClick={() => elsewhere.help()} title="Keys (?)" aria-label="keys">
        ?
      </button>
    </div>
  );
}
