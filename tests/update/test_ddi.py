"""The description of hawkBit's device API, and the model that answers by it."""

import copy
import json
import urllib.error
import urllib.request

import pytest
from patience import LIMIT_S

from . import ddi
from .hawkbit import HawkBit

FEEDBACK = {"id": "7", "status": {"execution": "proceeding", "result": {"finished": "none"}, "details": ["here"]}}


@pytest.fixture
def server(tmp_path):
    one = HawkBit("a-device", token="x")
    (tmp_path / "a.swu").write_bytes(b"bundle")
    one.offer(7, tmp_path / "a.swu", "1.0.0")
    yield one
    one.stop()


def ask(server, method, path, message=None):
    """The code, and what came back."""
    port = server.url.rsplit(":", 1)[1]
    request = urllib.request.Request(f"http://127.0.0.1:{port}{server.base}{path}", method=method,
                                     data=None if message is None else json.dumps(message).encode(),
                                     headers={"Authorization": f"TargetToken {server.token}"})
    try:
        with urllib.request.urlopen(request, timeout=LIMIT_S) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def test_what_the_model_answers_is_the_api_s(server):
    for method, path in (("GET", ""), ("GET", "/deploymentBase/7"), ("GET", "/cancelAction/7"),
                         ("GET", "/softwaremodules/1/artifacts/a.swu")):
        assert ask(server, method, path)[0] == 200
    assert ask(server, "PUT", "/configData", {"data": {"version": "1.0.0"}})[0] == 200
    assert ask(server, "POST", "/deploymentBase/7/feedback", FEEDBACK)[0] == 200
    assert not server.violations


@pytest.mark.parametrize("method, path, message", [
    ("GET", "/deploymentBase/8", None), ("GET", "/installedBase", None), ("GET", "/configData", None),
    ("PUT", "/configData", {"data": {"version": 1}}), ("PUT", "/configData", {"mode": "merge"}),
    ("POST", "/deploymentBase/7/feedback", {"status": {"execution": "done", "result": {"finished": "none"}}}),
    ("POST", "/deploymentBase/7/feedback", {"status": {"execution": "closed"}}),
    ("POST", "/cancelAction/7/feedback", {"status": {"execution": "closed", "result": {"finished": "yes"}}})])
def test_what_a_device_gets_wrong_is_seen(server, method, path, message):
    ask(server, method, path, message)
    assert len(server.violations) == 1


def test_so_is_what_the_model_gets_wrong(server):
    server.version = None
    ask(server, "GET", "/deploymentBase/7")
    assert any("ours: DdiDeploymentBase: $.deployment.chunks[0].version" in line for line in server.violations)
    assert ddi.wrong("DdiCancel", {"cancelAction": {"stopId": "7"}, "id": "7"}, exactly=True) == []
    assert ddi.wrong("DdiCancel", {"cancelAction": {"stopId": "7"}, "Id": "7"}, exactly=True)


def test_an_action_that_was_called_off_is_over(server):
    server.cancel()
    assert "cancelAction" in json.loads(ask(server, "GET", "")[1])["_links"]
    ask(server, "POST", "/cancelAction/7/feedback", {"status": {"execution": "closed", "result": {"finished": "success"}}})
    assert json.loads(ask(server, "GET", "")[1])["_links"].keys() == {"configData"}
    assert not server.violations
    assert ask(server, "POST", "/deploymentBase/7/feedback", FEEDBACK)[0] == 410
    assert server.violations


# --- against hawkBit's own ----------------------------------------------------------


def theirs():
    """A document in OpenAPI's form that says the same as ours."""
    def other_place(value):
        return json.loads(json.dumps(value).replace("#/$defs/", "#/components/schemas/"))

    def content(name):
        return {"content": {ddi_kind: {"schema": {"$ref": f"#/components/schemas/{name}"}}
                            for ddi_kind in ("application/json", "application/cbor")}} if name else {}
    paths = {}
    for name, its in ddi.OPERATIONS.items():
        method, _, path = name.partition(" ")
        paths.setdefault(f"{ddi.BASE}/{path}".rstrip("/"), {})[method.lower()] = {
            "requestBody": content(its.get("takes")),
            "responses": {str(code): content(its.get("gives")) if code == 200 else {} for code in its["codes"]}}
    return {"paths": paths, "components": {"schemas": other_place(copy.deepcopy(ddi.OURS["$defs"]))}}


@pytest.mark.parametrize("change", [
    lambda there: there["components"]["schemas"].pop("DdiCancel"),
    lambda there: there["components"]["schemas"]["DdiChunk"]["required"].append("artifacts"),
    lambda there: there["components"]["schemas"]["DdiResult"]["properties"]["finished"]["enum"].remove("none"),
    lambda there: there["components"]["schemas"]["DdiArtifact"]["properties"]["size"].update(type="string"),
    lambda there: there["components"]["schemas"]["DdiDeployment"]["properties"]["chunks"]["items"].update(
        {"$ref": "#/components/schemas/Links"}),
    lambda there: there["paths"].pop(f"{ddi.BASE}/configData"),
    lambda there: there["paths"][ddi.BASE]["get"]["responses"].pop("401"),
    lambda there: there["paths"][ddi.BASE]["get"]["responses"]["200"].pop("content")])
def test_a_difference_is_named(change):
    document = theirs()
    assert list(ddi.differences(document)) == []
    change(document)
    assert len(list(ddi.differences(document))) == 1
