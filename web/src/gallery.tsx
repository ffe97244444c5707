// Scenes to begin with.

import type { JSX } from "preact";
import { useDismiss } from "./dismiss";
import { host } from "./host";
import { choices, gallery, type Store, steers } from "./store";

/** Opens a scene on the web by its address. */
function Address({ store }: { store: Store }): JSX.Element {
  return (
    <form
      class="address"
      onSubmit={(event) => {
        event.preventDefault();
        const address = new FormData(event.currentTarget).get("address") as string;
        if (address.trim() !== "") void host.openAddress?.(store, address.trim());
      }}
    >
      <label>
        A scene on the web
        <input name="address" type="text" inputMode="url" placeholder="https://…/model.glb" />
      </label>
      <button type="submit" disabled={!steers.value}>
        Open
      </button>
    </form>
  );
}

/** Scenes to begin with. */
export function Gallery({ store }: { store: Store }): JSX.Element {
  useDismiss(true, () => (gallery.value = false), { covers: true });
  return (
    <div class="explain gallery" role="dialog" aria-label="scenes to look at">
      <header>
        <h2>Choose a scene, or drop a file</h2>
        <span class="quiet">glb, gltf, ply, obj, stl, off, scn, snell …</span>
        <span class="space" />
        <button onClick={() => (gallery.value = false)}>Close</button>
      </header>
      {host.openAddress && <Address store={store} />}
      <div class="cards">
        {choices.value?.scenes.map(({ name, description }) => (
          <button
            class="card"
            disabled={!steers.value}
            onClick={() => void store.open(`builtin=${encodeURIComponent(name)}`)}
          >
            <img src={host.thumbnail(name)} alt="" width="288" height="180" loading="lazy" />
            <strong>{name}</strong>
            <small class="quiet">{description}</small>
          </button>
        ))}
      </div>
    </div>
  );
}
