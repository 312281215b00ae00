#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks containers/ without a cluster: the YAML, names that must match, and the options of our programs.

    containers.py BUILD_ROOT
"""
import pathlib
import re
import subprocess
import sys

try:
    import yaml
except ImportError:
    print("PyYAML is missing (Debian: python3-yaml)")
    sys.exit(77)  # skipped

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(sys.argv[1]).resolve()
KINDS = {"lf-camera": {"DaemonSet"}, "lf-serve": {"Deployment", "HorizontalPodAutoscaler", "PodDisruptionBudget"},
         "lf-proxy": {"Deployment", "PodDisruptionBudget", "Service"}}


def check_pods(workload):
    spec, template = workload["spec"], workload["spec"]["template"]
    assert spec["selector"]["matchLabels"].items() <= template["metadata"]["labels"].items(), workload["metadata"]
    volumes = {volume["name"] for volume in template["spec"]["volumes"]}
    for container in template["spec"]["containers"]:
        assert {mount["name"] for mount in container["volumeMounts"]} == volumes, container["name"]
        ports = {port["name"] for port in container.get("ports", [])}
        for probe in container.get("readinessProbe"), container.get("livenessProbe"):
            assert not probe or probe["httpGet"]["port"] in ports, container["name"]
        assert "requests" in container["resources"], container["name"]


def main():
    documents = list(yaml.safe_load_all((ROOT / "containers/kubernetes.yaml").read_text()))
    objects = {(item["kind"], item["metadata"]["name"]): item for item in documents}
    assert len(objects) == len(documents)
    assert objects.keys() == {(kind, name) for name, kinds in KINDS.items() for kind in kinds}
    for (kind, name), item in objects.items():
        if kind in ("DaemonSet", "Deployment"):
            check_pods(item)
        elif kind == "PodDisruptionBudget":
            assert item["spec"]["selector"] == objects["Deployment", name]["spec"]["selector"]
        elif kind == "HorizontalPodAutoscaler":
            target = item["spec"]["scaleTargetRef"]
            assert (target["kind"], target["name"]) in objects

    serve = objects["Deployment", "lf-serve"]["spec"]["template"]["spec"]["containers"][0]
    assert serve["readinessProbe"]["httpGet"]["path"] == "/readyz"
    containerfile = (ROOT / "containers/Containerfile").read_text()
    used = set(re.findall(r"--[a-z-]+", serve["args"][0])) | set(re.findall(r"--[a-z-]+", containerfile.split("CMD")[1]))
    camera = objects["DaemonSet", "lf-camera"]["spec"]["template"]["spec"]["containers"][0]
    assert set(re.findall(r"--[a-z-]+", camera["args"][0])) == {"--metrics"}, camera["args"]
    texts = subprocess.run([BUILD / "tools/lf-serve", "--help"], capture_output=True, text=True, check=True).stdout
    assert used and used <= set(re.findall(r"--[a-z-]+", texts)), used

    packages = set(re.findall(r"/packages/([a-z0-9.-]+)_\*\.deb", containerfile))
    assert packages and packages <= set(re.findall(r"^Package: (\S+)", (ROOT / "debian/control").read_text(), re.M)), packages
    print(f"{len(documents)} objects of Kubernetes, {len(packages)} packages in the image")


main()
