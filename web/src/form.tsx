// Forms made from declarations: every declared parameter of a material, light or pattern can be
// edited.

import type { ComponentChildren, JSX } from "preact";
import { fromHex, toHex } from "./color";
import { clamped, NumberInput } from "./number";
import type { Form } from "./protocol.gen";

export type Json = null | boolean | number | string | Json[] | { [key: string]: Json };
export type Fields = { [key: string]: Json };

export interface FieldProps {
  label: string;
  /** What is shown instead of the label, where a title says the rest. */
  short?: string | undefined;
  value: Json;
  /** What the parameter is declared to be; none for what stands inside of measured data. */
  form?: Form | undefined;
  /** Path of the parameter, without the family. */
  path: string;
  change(path: string, value: Json): void;
  /** The place of a texture beside a value, at the path of the texture. */
  texture?(place: TexturePlace): ComponentChildren;
}

/** Where a parameter has a texture, or may have one. */
export interface TexturePlace {
  /** The parameter in words. */
  label: string;
  path: string;
  /** What stands there now. */
  value: Json;
  /** The texture's number. */
  texture: number | null;
  /** True for a colour, whose pictures are encoded with the sRGB curve. */
  isColor: boolean;
  /** What stands there with another texture. */
  with(texture: number): Json;
}

export const readable = (name: string): string => name.replaceAll("_", " ");

export const isFields = (value: Json | undefined): value is Fields =>
  value !== null && typeof value === "object" && !Array.isArray(value);

const isNumbers = (value: Json | undefined): value is number[] =>
  Array.isArray(value) && value.every((v) => typeof v === "number");

/** The words before a field, with its unit. */
function Caption({ label, form }: { label: string; form?: Form | undefined }): JSX.Element {
  return (
    <span>
      {readable(label)}
      {form?.unit && <small> {form.unit}</small>}
    </span>
  );
}

/** The form of what stands inside of a parameter: in a group, or in the value's variant. */
export function inside(form: Form | undefined, value: Fields, key: string): Form | undefined {
  if (!form) return undefined;
  const named = (fields: Form[] | undefined): Form | undefined =>
    fields?.find((field) => field.name === key);
  const kind = form.tag ? value[form.tag] : undefined;
  const found =
    named(form.fields) ?? (typeof kind === "string" ? named(form.kinds[kind]) : undefined);
  if (found || form.tag !== "" || !(key in form.kinds)) return found;
  // The name of the variant is the key around its parameters.
  return (
    form.kinds[key]!.find((field) => field.name === "") ?? {
      ...form,
      kind: "other",
      fields: form.kinds[key]!,
      kinds: {},
    }
  );
}

/** The names of what a group holds: as declared, and then what else there is. */
export function order(form: Form | undefined, value: Fields): string[] {
  const kind = form?.tag ? value[form.tag] : undefined;
  const declared = [
    ...(typeof kind === "string" ? (form?.kinds[kind] ?? []) : []),
    ...(form?.fields ?? []),
  ].map((field) => field.name);
  const known = declared.filter((name) => name in value);
  return [...known, ...Object.keys(value).filter((key) => !known.includes(key))];
}

/** The first colour of a form: the parameter that people look for first. */
export const colorIn = (fields: Form[]): Form | undefined =>
  fields.find((field) => field.kind === "color");

/** A value that a variant's parameter can begin with; undefined if none is known. */
function beginning(form: Form): Json | undefined {
  if (form.default !== null) return form.default as Json;
  if (form.kind === "flag") return false;
  if (form.kind === "choice") return form.options[0];
  if (form.kind !== "number") return undefined;
  if (form.range) return (form.range[0]! + form.range[1]!) / 2;
  return clamped(1, form.limits);
}

/** A variant of this name, as it is written in scenes; undefined if it needs more than is known. */
function variant(form: Form, name: string): Json | undefined {
  const fields = form.kinds[name] ?? [];
  const values = fields.map((field) => [field.name, beginning(field)] as const);
  if (values.some(([, value]) => value === undefined)) return undefined;
  const object = Object.fromEntries(values) as Fields;
  if (form.tag) return { [form.tag]: name, ...object };
  if (fields.length === 0) return name;
  return { [name]: "" in object ? object[""]! : object };
}

function NumberField(props: FieldProps & { value: number; children?: ComponentChildren }) {
  const { label, value, path, change, form } = props;
  const range = form?.range;
  const fallback = typeof form?.default === "number" ? form.default : undefined;
  return (
    <div class="field" title={form?.doc}>
      <Caption label={props.short ?? label} form={form} />
      {range && (
        <input
          type="range"
          min={range[0]}
          max={range[1]}
          step={(range[1]! - range[0]!) / 200}
          value={value}
          onInput={(e) => change(path, Number(e.currentTarget.value))}
          aria-label={readable(label)}
        />
      )}
      <NumberInput
        label={readable(label)}
        value={value}
        fallback={fallback}
        limits={form?.limits}
        change={(next) => next !== null && change(path, next)}
      />
      {props.children}
    </div>
  );
}

/** Fields for the numbers of a list. */
function Numbers(
  props: FieldProps & { value: number[]; names?: string[]; digits?: number },
): JSX.Element {
  const { label, value, path, change, form } = props;
  const before = isNumbers(form?.default as Json) ? (form!.default as number[]) : [];
  return (
    <>
      {value.map((v, i) => (
        <NumberInput
          class="narrow"
          digits={props.digits}
          label={`${readable(label)} ${props.names?.[i] ?? i + 1}`}
          value={v}
          fallback={before[i]}
          limits={form?.limits}
          change={(next) =>
            next !== null &&
            change(
              path,
              value.map((old, j) => (j === i ? next : old)),
            )
          }
        />
      ))}
    </>
  );
}

const CHANNELS = ["red", "green", "blue"];

function ColorField(props: FieldProps & { value: number[]; children?: ComponentChildren }) {
  const { label, value, path, change, form } = props;
  const most = Math.max(...value);
  const isLight = form?.limits[1] !== 1;
  const usual = form?.default as Json;
  return (
    <>
      <div class="field" title={form?.doc}>
        <Caption label={props.short ?? label} form={form} />
        <input
          type="color"
          value={toHex(value)}
          aria-label={readable(label)}
          onInput={(e) => change(path, fromHex(e.currentTarget.value, value))}
        />
        {isLight ? (
          <>
            <small>×</small>
            <NumberInput
              label={`${readable(label)} strength`}
              value={most}
              fallback={isNumbers(usual) ? Math.max(...usual) : undefined}
              limits={[0, form?.limits[1] ?? null]}
              change={(next) =>
                next !== null &&
                change(
                  path,
                  most > 0
                    ? value.map((v) => Number(((v / most) * next).toPrecision(6)))
                    : [next, next, next],
                )
              }
            />
          </>
        ) : (
          <Numbers {...props} names={CHANNELS} digits={3} />
        )}
        {props.children}
      </div>
      {isLight && (
        <div class="field below">
          <Numbers {...props} names={CHANNELS} digits={3} />
        </div>
      )}
    </>
  );
}

/** A list of names to choose from. */
function ChoiceField(props: FieldProps & { now: string; children?: ComponentChildren }) {
  const { label, form, now, path, change } = props;
  const names = form!.options.filter((name) => name === now || variant(form!, name) !== undefined);
  return (
    <label class="field" title={form?.doc}>
      <Caption label={props.short ?? label} form={form} />
      <select
        value={now}
        aria-label={readable(label)}
        onChange={(e) => change(path, variant(form!, e.currentTarget.value)!)}
      >
        {names.map((name) => (
          <option value={name}>{readable(name)}</option>
        ))}
      </select>
    </label>
  );
}

/** A group of fields under a title. */
function Group(props: { title: string; doc?: string | undefined; children: ComponentChildren }) {
  return (
    <fieldset class="group" aria-label={readable(props.title)} title={props.doc}>
      <span class="title">{readable(props.title)}</span>
      {props.children}
    </fieldset>
  );
}

/** A number or colour that a texture may multiply. */
function Factor(props: FieldProps & { value: Fields }): JSX.Element {
  const { value, path, form, label } = props;
  const { factor, texture: held, spectrum } = value;
  const channel = Array.isArray(held) ? (held[1] as number) : null;
  const number = Array.isArray(held) ? held[0] : held;
  const isColor = form?.kind === "color";
  const place: TexturePlace = {
    label: readable(label),
    path: `${path}.texture`,
    value: held ?? null,
    texture: typeof number === "number" ? number : null,
    isColor,
    with: (next) => (isColor ? next : [next, channel ?? 0]),
  };
  const inner: FieldProps = {
    ...props,
    path: `${path}.factor`,
    value: factor!,
    form: form && {
      ...form,
      default: isFields(form.default as Json) ? (form.default as Fields).factor : form.default,
      // A factor may be large where the texture is dark.
      limits: place.texture === null ? form.limits : [form.limits[0]!, null],
    },
  };
  const slot = form?.is_textured ? props.texture?.(place) : null;
  return (
    <>
      {typeof factor === "number" ? (
        <NumberField {...inner} value={factor}>
          {slot}
        </NumberField>
      ) : (
        <ColorField {...inner} value={factor as number[]}>
          {slot}
        </ColorField>
      )}
      {spectrum !== null && spectrum !== undefined && (
        <div class="field below">
          <em>times a spectrum</em>
        </div>
      )}
    </>
  );
}

/** A field for one parameter, or a group of fields. */
export function Field(props: FieldProps): JSX.Element | null {
  const { label, value, path, change, form } = props;
  if (typeof value === "number") {
    if (form?.kind === "texture") return <TextureField {...props} />;
    return <NumberField {...props} value={value} />;
  }
  if (typeof value === "boolean") {
    return (
      <label class="field" title={form?.doc}>
        <Caption label={props.short ?? label} form={form} />
        <input
          type="checkbox"
          checked={value}
          aria-label={readable(label)}
          onChange={(e) => change(path, e.currentTarget.checked)}
        />
      </label>
    );
  }
  if (form?.kind === "color" && isNumbers(value) && value.length === 3)
    return <ColorField {...props} value={value} />;
  if (isNumbers(value)) {
    return (
      <div class="field" title={form?.doc}>
        <Caption label={props.short ?? label} form={form} />
        <Numbers {...props} value={value} names={value.length === 3 ? ["x", "y", "z"] : []} />
      </div>
    );
  }
  if (Array.isArray(value)) {
    const rows = value.filter((row) => isNumbers(row)) as number[][];
    if (rows.length !== value.length || rows.length > 4)
      return <Fact {...props} text={`${value.length} values`} />;
    return (
      <Group title={label} doc={form?.doc}>
        {rows.map((row, i) => (
          <div class="field">
            <Numbers
              {...props}
              form={form && { ...form, default: null }}
              label={`${label} ${i + 1}`}
              value={row}
              path={`${path}.${i}`}
            />
          </div>
        ))}
      </Group>
    );
  }
  if (isFields(value) && "factor" in value) return <Factor {...props} value={value} />;
  const isChoice = form !== undefined && form.options.length > 0;
  if (typeof value === "string") {
    return isChoice ? <ChoiceField {...props} now={value} /> : <Fact {...props} text={value} />;
  }
  if (isFields(value)) {
    const keys = order(form, value);
    const now = isChoice ? String(form.tag ? value[form.tag] : keys[0]) : "";
    // A variant with one unnamed parameter is that parameter.
    const isPlain = isChoice && !form.tag && !isFields(value[now]);
    return (
      <Group title={label} doc={form?.doc}>
        {isChoice && <ChoiceField {...props} short={undefined} label="kind" now={now} />}
        {keys
          .filter((key) => !(form?.tag && key === form.tag))
          .map((key) => {
            const inner = inside(form, value, key);
            const own = isChoice && !form.tag && isFields(value[key]);
            const held = own ? (value[key] as Fields) : null;
            if (held) {
              return order(inner, held).map((name) => (
                <Field
                  {...props}
                  key={name}
                  short={undefined}
                  label={name}
                  value={held[name]!}
                  path={`${path}.${key}.${name}`}
                  form={inside(inner, held, name)}
                />
              ));
            }
            return (
              <Field
                {...props}
                key={key}
                short={undefined}
                label={isPlain ? label : key}
                value={value[key]!}
                path={`${path}.${key}`}
                form={inner}
              />
            );
          })}
      </Group>
    );
  }
  return <Absent {...props} />;
}

/** What is shown and not edited. */
function Fact(props: FieldProps & { text: string }): JSX.Element {
  const { label, form, text } = props;
  return (
    <div class="field" title={form?.doc}>
      <Caption label={props.short ?? label} form={form} />
      <em>{text}</em>
    </div>
  );
}

/** The number of a texture that has no factor. */
function TextureField(props: FieldProps): JSX.Element {
  const { label, value, path, form } = props;
  const texture = typeof value === "number" ? value : null;
  return (
    <div class="field" title={form?.doc}>
      <Caption label={props.short ?? label} form={form} />
      {props.texture?.({
        label: readable(label),
        path,
        value,
        texture,
        isColor: false,
        with: (next) => next,
      })}
    </div>
  );
}

/** A parameter that is not there, and how it may come. */
function Absent(props: FieldProps): JSX.Element {
  const { label, path, change, form } = props;
  const picture = form?.fields.find((field) => field.kind === "texture");
  return (
    <div class="field" title={form?.doc}>
      <Caption label={props.short ?? label} form={form} />
      {form?.kind === "number" ? (
        <NumberInput
          label={readable(label)}
          value={null}
          fallback={null}
          limits={form.limits}
          change={(next) => next !== null && change(path, next)}
        />
      ) : form?.kind === "texture" ? (
        props.texture?.({
          label: readable(label),
          path,
          value: null,
          texture: null,
          isColor: false,
          with: (next) => next,
        })
      ) : picture ? (
        props.texture?.({
          label: readable(label),
          path,
          value: null,
          texture: null,
          isColor: false,
          with: (next) => ({ [picture.name]: next }),
        })
      ) : (
        <em>none</em>
      )}
    </div>
  );
}
