"""The manifest's JSON Schema, and its errors as problems that a person can mend."""

import json
from collections.abc import Iterator, Mapping
from importlib.resources import files
from typing import Any, Final

from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError

from graspdb_schemas.errors import Problem, nearest
from graspdb_schemas.manifest_yaml import describe, join_key, table

SCHEMA_FILE: Final = "session.schema.json"

_TYPES: Final = {
    "object": "a table (key: value)",
    "array": "a list",
    "string": "text",
    "number": "a number",
    "integer": "a whole number",
}


def session_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of ``session.yaml``."""
    text = files("graspdb_schemas").joinpath(SCHEMA_FILE).read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def schema_problems(manifest: object) -> list[Problem]:
    """Return everything in a manifest that its JSON Schema does not allow, in the manifest's order."""
    errors = sorted(Draft202012Validator(session_schema()).iter_errors(manifest), key=_place)
    return [problem for error in errors for problem in _explain(error)]


def _place(error: ValidationError) -> list[str]:
    return [f"{part:06d}" if isinstance(part, int) else str(part) for part in error.absolute_path]


def _explain(error: ValidationError) -> Iterator[Problem]:
    path = ""
    for part in error.absolute_path:
        path = join_key(path, part)
    if "propertyNames" in error.absolute_schema_path:
        yield Problem(
            join_key(path, str(error.instance)), f"the key {describe(error.instance)}", _allowed(error)
        )
    elif error.validator == "additionalProperties":
        known = list(_schema_of(error)["properties"])
        for key in table(error.instance):
            if key not in known:
                hint = nearest(key, known)
                yield Problem(join_key(path, key), "a key that is not known", ", ".join(known) + hint)
    elif error.validator == "required":
        yield from _missing(error, path)
    else:
        yield Problem(path or "the manifest", describe(error.instance), _allowed(error))


def _schema_of(error: ValidationError) -> Mapping[str, Any]:
    return error.schema if isinstance(error.schema, Mapping) else {}


def _missing(error: ValidationError, path: str) -> Iterator[Problem]:
    """Yield one problem for each key that is missing; a key like it may be a slip of the pen."""
    known = _schema_of(error).get("properties", {})
    entry, required = table(error.instance), _schema_of(error)["required"]
    extra = [key for key in entry if key not in known]
    for key in required:
        if key in entry or error.message != f"{key!r} is a required property":
            continue
        meaning = known.get(key, {}).get("description", "a value")
        slip = nearest(key, extra).replace("did you mean", "is it what was meant by")
        yield Problem(join_key(path, key), "nothing", meaning + slip)


def _allowed(error: ValidationError) -> str:
    """Return in words what the schema allows where an error stands."""
    value: Any = error.validator_value
    schema = _schema_of(error)
    match error.validator:
        case "type":
            kinds = [value] if isinstance(value, str) else value
            words = " or ".join(_TYPES[kind] for kind in kinds)
            if "string" in kinds and isinstance(error.instance, int | float):
                words += ", in quotes"
        case "enum":
            names = [str(name) for name in value]
            words = ", ".join(names) + (nearest(str(error.instance), names) if error.instance else "")
        case "const":
            words = str(value) + (nearest(str(error.instance), [str(value)]) if error.instance else "")
        case "exclusiveMinimum":
            words = f"a number above {value}"
        case "minimum":
            words = f"{value} or more"
        case "minItems" | "maxItems":
            low, high = schema.get("minItems"), schema.get("maxItems")
            words = f"a list of {low}" if low == high else f"at least {low}"
        case "minProperties":
            words = f"at least {value}"
        case "minLength":
            words = "text that is not empty"
        case "oneOf":
            words = "either at or offset, not both and not neither"
        case "pattern":
            return str(schema.get("description", f"text of the form {value}"))
        case _:
            words = error.message
    meaning = schema.get("description", "")
    return f"{words} ({meaning})" if meaning else words
