// The tree of the scene.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import type { NodeInfo } from "../protocol.gen";
import { select, selection } from "../select";
import { picked, type Store, scene } from "../store";
import { Section } from "./section";

/** Maximum number of nodes shown without a filter. */
const SHOWN_NODES = 400;

export function TreeSection({ store }: { store: Store }): JSX.Element | null {
  const filter = useSignal("");
  const info = scene.value;
  if (!info) return null;
  const depth = new Map<number, number>();
  for (const node of info.nodes)
    depth.set(node.id, node.parent === null ? 0 : (depth.get(node.parent) ?? 0) + 1);
  const parents = new Map(info.nodes.map((node) => [node.id, node.parent]));
  /** The nodes from the root to this one. */
  const pathTo = (id: number): number[] => {
    const above = parents.get(id) ?? null;
    return above === null ? [id] : [...pathTo(above), id];
  };
  const chosen = selection.value?.path.at(-1) ?? null;
  const wanted = filter.value.toLowerCase();
  const matches = (n: NodeInfo): boolean => !wanted || n.name.toLowerCase().includes(wanted);
  const all = info.nodes.filter(matches);
  const row = (node: NodeInfo): JSX.Element => (
    <li
      style={{ paddingLeft: `${Math.min(12, depth.get(node.id) ?? 0) * 0.7}em` }}
      class={chosen === node.id ? "picked" : ""}
    >
      <label>
        <input
          type="checkbox"
          checked={node.visible}
          aria-label={`show ${node.name}`}
          onChange={(e) =>
            store.send({ type: "show", node: node.id, visible: e.currentTarget.checked })
          }
        />
      </label>
      <button
        class="plain"
        aria-pressed={chosen === node.id}
        onClick={() => {
          // What was picked is selected no more.
          picked.value = null;
          select(chosen === node.id ? null : pathTo(node.id));
        }}
      >
        {node.name || `node ${node.id}`}
      </button>
      {node.surfaces.length > 0 && <small>{node.surfaces.join(", ")}</small>}
    </li>
  );
  const left = all.length - SHOWN_NODES + info.nodes_left_out;
  return (
    <Section
      title={`Scene (${info.nodes.length + info.nodes_left_out} nodes)`}
      open={info.nodes.length < 30}
    >
      <input
        type="search"
        placeholder="Find by name"
        aria-label="find nodes by name"
        value={filter.value}
        onInput={(e) => (filter.value = e.currentTarget.value)}
      />
      <ul class="tree">{all.slice(0, SHOWN_NODES).map(row)}</ul>
      {left > 0 && <small>and {left} more: find them by name</small>}
    </Section>
  );
}
