// The page: the picture, a bar above it, a panel beside it, and numbers below it.

import { useSignal } from "@preact/signals";
import { type JSX, render } from "preact";
import { Bar } from "./bar";
import { Costs } from "./costs";
import { listenForDismissal, useDismiss } from "./dismiss";
import { take } from "./drop";
import { Explain } from "./explain";
import { Gallery } from "./gallery";
import { Help } from "./help";
import { Panel } from "./panel/panel";
import { followSelection } from "./select";
import { Stage } from "./stage";
import { Status } from "./status";
import { costs, gallery, notices, Store, steers } from "./store";
import "./style/base.css";
import "./style/bar.css";
import "./style/stage.css";
import "./style/panel.css";
import "./style/status.css";
import "./style/explain.css";
import "./style/animation.css";
import "./style/gallery.css";
import "./style/tools.css";
import "./style/narrow.css";

export const store = new Store();
followSelection(store);

function App(): JSX.Element {
  const help = useSignal(false);
  const narrow = window.matchMedia("(max-width: 760px)");
  const panel = useSignal(!narrow.matches);
  const dropping = useSignal(false);
  const elsewhere = {
    help: () => {
      help.value = !help.value;
    },
    panel: () => {
      panel.value = !panel.value;
    },
    hasPanel: () => panel.value,
    closeSheet: () => {
      if (!narrow.matches || !panel.value) return false;
      panel.value = false;
      return true;
    },
  };
  useDismiss(panel.value && narrow.matches, () => (panel.value = false));
  const drop = (event: DragEvent): void => {
    event.preventDefault();
    dropping.value = false;
    if (event.dataTransfer) void take(store, event.dataTransfer);
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
      <Bar store={store} elsewhere={elsewhere} />
      <div class="middle">
        <Stage store={store} elsewhere={elsewhere} />
        <Explain store={store} />
        {costs.value && <Costs />}
        {gallery.value && <Gallery store={store} />}
        {panel.value && (
          <div class="side">
            <header class="sheet-head">
              <strong>Settings</strong>
              <span class="space" />
              <button onClick={() => (panel.value = false)}>Close</button>
            </header>
            <div class="settings" inert={!steers.value}>
              <Panel store={store} />
            </div>
          </div>
        )}
      </div>
      <Status />
      {help.value && <Help close={() => (help.value = false)} />}
      {dropping.value && (
        <div class="drop">
          Drop a scene with its files, a folder, or a picture (hdr, exr) to light it
        </div>
      )}
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

listenForDismissal();
render(<App />, document.getElementById("app")!);
