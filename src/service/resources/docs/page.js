"use strict";
// Draws /openapi.json. Everything on the page comes from that document, as text and never as markup.

const METHODS = ["get", "post", "put", "patch", "delete"];
let api;

function element(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children.filter((child) => child !== undefined && child !== ""));
  return node;
}

function resolve(schema) {
  if (!schema || !schema.$ref) return schema ?? {};
  return schema.$ref.slice(2).split("/").reduce((at, key) => at?.[key.replaceAll("~1", "/").replaceAll("~0", "~")], api) ?? {};
}

/** A text whose `words` stand in backticks: those as code. */
function prose(text) {
  return (text ?? "").split("`").map((part, k) => (k % 2 ? element("code", {}, part) : part));
}

/** A schema in a few words. */
function words(schema) {
  if (!schema) return "";
  if (schema.$ref) {
    const target = resolve(schema);
    return target.enum ? words(target) : schema.$ref.split("/").pop();
  }
  const either = schema.oneOf ?? schema.anyOf;
  if (either) {
    const constants = either.map((one) => resolve(one)).flatMap((one) => one.enum ?? (one.const === undefined ? [] : [one.const]));
    if (constants.length) return constants.join(" | ");
    return either.map(words).filter((text) => text !== "null").join(" or ");
  }
  if (schema.enum) return schema.enum.join(" | ");
  if (schema.allOf) return schema.allOf.map(words).join(" & ");
  const type = [schema.type ?? "any"].flat().filter((one) => one !== "null").join(" or ");
  if (type === "array") {
    const count = schema.minItems || schema.maxItems ? ` (${schema.minItems ?? 0} to ${schema.maxItems ?? "any"})` : "";
    return `list of ${words(schema.items)}${count}`;
  }
  const range = [];
  if (schema.minimum !== undefined) range.push(`≥ ${schema.minimum}`);
  if (schema.maximum !== undefined) range.push(`≤ ${schema.maximum}`);
  if (schema.pattern) range.push(schema.pattern);
  return [type, ...range].join(" ");
}

function table(heads, rows) {
  const head = element("tr", {}, ...heads.map((text) => element("th", {}, text)));
  return element("table", {}, head, ...rows.map((cells) => element("tr", {}, ...cells.map((cell) => element("td", {}, ...(typeof cell === "string" ? prose(cell) : [cell ?? ""]))))));
}

function properties(schema) {
  const object = resolve(schema);
  if (!object.properties) return undefined;
  const needed = new Set(object.required ?? []);
  return table(["field", "", "what it is"], Object.entries(object.properties).map(([name, property]) => [
    element("code", {}, name), words(property) + (needed.has(name) ? "" : ", optional"), property.description ?? resolve(property).description ?? "",
  ]));
}

/** How curl asks for it. */
function curl(method, path, operation) {
  const required = (operation.parameters ?? []).filter((one) => one.in === "query" && one.required);
  const query = required.length ? "?" + required.map((one) => `${one.name}=…`).join("&") : "";
  const words = ["curl"];
  if (method !== "get") words.push("-X", method.toUpperCase());
  const types = Object.keys(operation.requestBody?.content ?? {});
  if (types.includes("application/json")) words.push("-H 'Content-Type: application/json'", "-d '{…}'");
  else if (types.length) words.push("-H 'Content-Type: application/octet-stream'", "--data-binary @FILE");
  words.push(`'${location.origin}${path}${query}'`);
  return words.join(" ");
}

function operationNode(method, path, operation) {
  const body = element("div", {});
  if (operation.description) body.append(element("p", { class: "description" }, ...prose(operation.description)));
  body.append(element("pre", {}, curl(method, path, operation)));
  if (operation.parameters?.length) {
    body.append(table(["parameter", "in", "", "what it is"], operation.parameters.map((one) => [
      element("code", {}, one.name), one.in, words(one.schema) + (one.required ? "" : ", optional"), one.description ?? "",
    ])));
  }
  const json = operation.requestBody?.content?.["application/json"];
  if (json) body.append(element("h4", {}, "Body"), properties(json.schema) ?? "");
  body.append(element("h4", {}, "Answers"), table(["status", "type", "what it is"], Object.entries(operation.responses ?? {}).map(([status, answer]) => [
    status, Object.keys(answer.content ?? {}).join(", "), answer.description,
  ])));
  const shown = Object.values(operation.responses ?? {}).map((answer) => answer.content?.["application/json"]?.schema).find((schema) => schema?.$ref);
  const fields = shown && properties(shown);
  if (fields) body.append(element("h4", {}, words(shown)), fields);
  return element("details", { id: operation.operationId ?? "" },
    element("summary", {}, element("span", { class: "method" }, method.toUpperCase()), element("span", { class: "path" }, path),
      element("span", { class: "short" }, ...prose(operation.summary))),
    body);
}

async function draw() {
  const about = document.getElementById("about");
  try {
    api = await (await fetch("/openapi.json")).json();
  } catch (error) {
    about.textContent = `/openapi.json could not be read: ${error}`;
    return;
  }
  about.replaceChildren(...prose(api.info.description));
  about.classList.add("description");
  for (const tag of api.tags ?? []) {
    document.getElementById("tags").append(element("a", { href: `#${tag.name}` }, tag.name));
    const section = element("section", { id: tag.name }, element("h2", {}, tag.name), element("p", {}, ...prose(tag.description)));
    for (const [path, item] of Object.entries(api.paths)) {
      for (const method of METHODS) {
        if (item[method]?.tags?.includes(tag.name)) section.append(operationNode(method, path, item[method]));
      }
    }
    document.getElementById("operations").append(section);
  }
}

draw();
