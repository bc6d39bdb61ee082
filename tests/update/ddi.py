"""hawkBit's device API ("DDI"): ddi.json says which operations and messages there are, as far as they are used here.

    python3 -m update.ddi PAGE

holds ddi.json against the API's description as hawkBit publishes it (docs/rest-api/ddi.html in its sources, or the
OpenAPI document itself, /v3/api-docs of a server), and names what isn't the same there.
"""

import argparse
import json
import re
import sys
from pathlib import Path

import jsonschema

OURS = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
OPERATIONS = OURS["operations"]
BASE = "/{tenant}/controller/v1/{controllerId}"
EMBEDDED = "__redoc_state = "
REFERENCE = re.compile(r".*/(\w+)")


def strict(schema):
    """The same, and fields that aren't named are wrong: for what we send. What we are sent may have more."""
    if isinstance(schema, list):
        return [strict(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    more = {"additionalProperties": False} if "properties" in schema and schema.get("type") == "object" else {}
    return more | {key: strict(value) for key, value in schema.items()}


def wrong(name, message, exactly=False):
    """What in a message isn't as `name` in ddi.json has it: lines; none when all is well."""
    definitions = strict(OURS["$defs"]) if exactly else OURS["$defs"]
    validator = jsonschema.Draft202012Validator({"$ref": f"#/$defs/{name}", "$defs": definitions})
    return [f"{name}: {error.json_path}: {error.message}" for error in validator.iter_errors(message)]


def operation(method, path):
    """An operation's name in ddi.json and its path's parts, for what comes behind the device's own path; or None, []."""
    for name in OPERATIONS:
        its_method, _, its_path = name.partition(" ")
        pattern = re.sub(r"\{\w+\}", "([^/]+)", its_path)
        match = re.fullmatch(pattern, path.strip("/"))
        if match and method == its_method:
            return name, list(match.groups())
    return None, []


# --- against hawkBit's own ----------------------------------------------------------


def published(path):
    """The OpenAPI document; in hawkBit's page it is the first value in a script."""
    text = Path(path).read_text(encoding="utf-8")
    if EMBEDDED in text:
        return json.JSONDecoder().raw_decode(text, text.index(EMBEDDED) + len(EMBEDDED))[0]["spec"]["data"]
    return json.loads(text)


def shape(schema):
    """What two descriptions have to agree about: types, references, values, which fields a message can't lack."""
    if "$ref" in schema:
        return REFERENCE.fullmatch(schema["$ref"])[1]
    return {"type": schema.get("type"), "enum": sorted(schema.get("enum", [])), "required": sorted(schema.get("required", [])),
            "items": shape(schema.get("items", {})) if "items" in schema else None,
            "more": shape(schema["additionalProperties"]) if "additionalProperties" in schema else None}


def differences(theirs):
    for name, ours in OURS["$defs"].items():
        other = theirs["components"]["schemas"].get(name)
        if other is None:
            yield f"{name}: hawkBit has no such message"
            continue
        if shape(ours) != shape(other):
            yield f"{name}: {shape(ours)} here, {shape(other)} there"
        for field, schema in ours.get("properties", {}).items():
            their_field = other.get("properties", {}).get(field)
            if their_field is None or shape(schema) != shape(their_field):
                yield f"{name}.{field}: {shape(schema)} here, {their_field and shape(their_field)} there"
    for name, ours in OPERATIONS.items():
        method, _, path = name.partition(" ")
        other = theirs["paths"].get(f"{BASE}/{path}".rstrip("/"), {}).get(method.lower())
        if other is None:
            yield f"{name}: hawkBit has no such operation"
            continue
        for field, where in (("takes", other.get("requestBody", {})), ("gives", other["responses"]["200"])):
            kinds = {shape(kind["schema"]) for kind in where.get("content", {}).values() if "$ref" in kind["schema"]}
            if kinds != ({ours[field]} if field in ours else set()):
                yield f"{name}: {field} {ours.get(field)} here, {sorted(kinds)} there"
        for code in ours["codes"]:
            # A part of a file (RFC 9110), of which its page speaks in words.
            if str(code) not in other["responses"] and code != 206:
                yield f"{name}: {code} isn't among {sorted(other['responses'])}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", help="docs/rest-api/ddi.html of hawkBit's sources, or an OpenAPI document")
    found = list(differences(published(parser.parse_args().page)))
    for line in found:
        print(line)
    print(f"{len(OURS['$defs'])} messages, {len(OPERATIONS)} operations: {len(found)} differences")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
