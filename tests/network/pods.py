#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs the pods of containers/kubernetes.yaml with "podman kube play": two camera hosts, two lf-serve and HAProxy. The key
is replaced while viewers watch, and a pod is killed while a browser shows its pictures. Needs root, podman,
mmdebstrap, Chromium, Node.js and npm, and a Debian mirror for the first run, which makes the base image.

    pods.py BUILD_ROOT

podman has no nodes, ConfigMaps of files and DaemonSets, so this script makes a Pod from the template of each workload. A
pod has its own address instead of the network of a node.
"""
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zlib

if "--help" in sys.argv:
    sys.exit(print(__doc__))
try:
    import yaml
except ImportError:
    sys.exit(77)  # skipped

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/soak"))
from hosts import until  # noqa: E402

BUILD = pathlib.Path(sys.argv[1]).resolve()
PACKAGES = ("tini,haproxy,dbus-x11,gstreamer1.0-tools,gstreamer1.0-plugins-base,gstreamer1.0-plugins-good,gstreamer1.0-plugins-bad,"
            "gstreamer1.0-plugins-ugly,gstreamer1.0-nice,libsoup-3.0-0,libopencv-core406,libopencv-imgproc406,"
            "libjpeg62-turbo,libpng16-16,libtiff6,libwebp7,libegl1,libgles2")
BASE, IMAGE = f"localhost/lightfield-base-{zlib.crc32(PACKAGES.encode())}", "localhost/lightfield"
ADDRESSES = {name: f"10.88.0.{200 + i}" for i, name in enumerate(["cam0", "cam1", "r1", "r2", "proxy"])}
SERVERS, VIEWERS, GATEWAY = ["r1", "r2"], 4, "10.88.0.1"
OLD_KEY, NEW_KEY = "0123456789abcdef" * 4, "fedcba9876543210" * 4
HYBRID = pathlib.Path("/sys/fs/cgroup/unified")
# crun, but without limits of resources, because podman sets limits that a root user without CAP_SYS_RESOURCE cannot have.
RUNTIME = """#!/usr/bin/python3
import json, os, pathlib, sys
if "create" in sys.argv:
    file = pathlib.Path(sys.argv[sys.argv.index("--bundle") + 1], "config.json")
    config = json.loads(file.read_text())
    config["process"].pop("rlimits", None)
    file.write_text(json.dumps(config))
os.execvp("crun", ["crun", *sys.argv[1:]])
"""


def run(*command, **more):
    result = subprocess.run(command, capture_output=True, text=True, **more)
    if result.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}:\n{result.stdout[-2000:]}{result.stderr[-2000:]}")
    return result.stdout


def make_image(folder):
    if subprocess.run(["podman", "image", "exists", BASE]).returncode != 0:
        run("mmdebstrap", "--variant=minbase", f"--include={PACKAGES}", "bookworm", f"{folder}/base.tar")
        run("podman", "import", f"{folder}/base.tar", BASE)
    programs = {"tools/lf-serve": "/usr/bin/", "tools/lf-run": "/usr/bin/",
                "gst/libgstlightfield.so": "/usr/lib/x86_64-linux-gnu/gstreamer-1.0/"}
    context = pathlib.Path(folder, "image")
    context.mkdir()
    for name in programs:
        shutil.copy(BUILD / name, context)
    copies = [f"COPY {pathlib.Path(name).name} {place}" for name, place in programs.items()]
    user = "RUN groupadd --system --force render && useradd --uid 1000 --groups video,render --create-home lightfield"
    (context / "Containerfile").write_text("\n".join([f"FROM {BASE}", *copies, user]) + "\n")
    run("podman", "build", "--network", "none", "-t", IMAGE, str(context))


def pod_of(workload, name, volumes):
    """Returns the Pod of a workload on the node `name`. `volumes` maps the names of volumes to folders."""
    spec = workload["spec"]["template"]["spec"]
    for key in "hostNetwork", "dnsPolicy", "nodeSelector":
        spec.pop(key, None)
    spec["volumes"] = [{"name": volume["name"], "hostPath": {"path": str(volumes[volume["name"]]), "type": "Directory"}}
                       if volume["name"] in volumes else volume for volume in spec["volumes"]]
    values = {"spec.nodeName": name, "status.hostIP": ADDRESSES[name]}
    for container in spec["containers"]:
        container["image"] = IMAGE
        for key in "readinessProbe", "livenessProbe", "ports":
            container.pop(key, None)
        for variable in container.get("env", []):
            variable["value"] = values[variable.pop("valueFrom")["fieldRef"]["fieldPath"]]
        if container["name"] == "haproxy":
            container["command"] = ["haproxy", "-db", "-f", "/usr/local/etc/haproxy/haproxy.cfg"]
    return {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": name}, "spec": spec}


def write_key(folder, *keys):
    """Writes the volume of a Secret as Kubernetes does: a folder for each version, and a link that is replaced."""
    secret = pathlib.Path(folder, "secret")
    version = secret / f"..{time.monotonic_ns()}"
    version.mkdir(parents=True)
    (version / "key").write_text("\n".join(keys))
    (version / "key").chmod(0o400)
    for path in secret, version, version / "key":
        os.chown(path, 1000, 1000)
    (secret / "..new").symlink_to(version.name)
    (secret / "..new").rename(secret / "..data")
    if not (secret / "key").is_symlink():
        (secret / "key").symlink_to("..data/key")


def write_configuration(folder):
    config = pathlib.Path(folder, "config")
    run(f"{BUILD}/tools/lf-scene", "--out", str(config), "--grid", "4x4", "--width", "320", "--height", "240", "--frames",
        "10", "--framerate", "5", "--samples", "1", env={**os.environ, "GST_PLUGIN_PATH": f"{BUILD}/gst"})
    answers = [",".join(f"{ADDRESSES[server]}:{6100 + node}" for server in SERVERS) for node in range(2)]
    for node, cameras in enumerate(["0-7", "8-15"]):
        (config / f"camera-cam{node}.conf").write_text(
            f"cameras={cameras} node={node} listen=6001,6002 answers={answers[node]}\n")
    for i, server in enumerate(SERVERS):
        nodes = ",".join(f"{ADDRESSES[f'cam{node}']}:{6001 + i}:{6100 + node}" for node in range(2))
        (config / f"serve-{server}.conf").write_text(
            f"--replica {server} --nodes {nodes} --proxy {ADDRESSES['proxy']} --connects 100 --framerate 5 "
            "--focus-mode plane\n")
    proxy = pathlib.Path(folder, "proxy")
    proxy.mkdir()
    text = re.sub(r"\n  server r[34] .*", "", (ROOT / "pipelines/haproxy/haproxy.cfg").read_text())
    (proxy / "haproxy.cfg").write_text(re.sub(r"server (r\d) \S+", lambda m: f"server {m[1]} {ADDRESSES[m[1]]}:8080", text))
    write_key(folder, OLD_KEY)
    for path in [pathlib.Path(folder), config, proxy, *config.rglob("*")]:
        path.chmod(0o755)
    return {"rig": config, "key": pathlib.Path(folder, "secret"), "configuration": proxy}


def remove_pods():
    run("podman", "pod", "rm", "--force", "--ignore", "--time", "0", *ADDRESSES)


def play(folder, volumes):
    documents = (ROOT / "containers/kubernetes.yaml").read_text()
    for name in ADDRESSES:
        kind = {"cam": "lf-camera", "r": "lf-serve", "proxy": "lf-proxy"}[name.rstrip("0123456789")]
        workload = next(item for item in yaml.safe_load_all(documents)
                        if item["metadata"]["name"] == kind and item["kind"] in ("DaemonSet", "Deployment"))
        file = pathlib.Path(folder, f"{name}.yaml")
        file.write_text(yaml.safe_dump(pod_of(workload, name, volumes)))
        run("podman", "kube", "play", "--network", "podman", "--ip", ADDRESSES[name], str(file))


def fetch(address, path, port=8080):
    return subprocess.run(["curl", "-sf", "--max-time", "5", f"http://{address}:{port}/{path}"], capture_output=True,
                          text=True).stdout


def metric(host, name, port=8080):
    found = re.findall(rf"^lightfield_{name}(?:{{.*}})? (\S+)$", fetch(ADDRESSES[host], "metrics", port), re.M)
    return sum(map(float, found)) if found else -1


def viewers(server):
    return metric(server, "viewers")


class Watch:
    """Viewers behind the proxy."""

    def __init__(self, count, seconds):
        self.program = subprocess.Popen([f"{BUILD}/tests/watch", f"http://{ADDRESSES['proxy']}:8080/", str(count), "320",
                                         "240", str(seconds), GATEWAY], stdout=subprocess.PIPE, text=True)
        assert self.program.stdout.readline() == "ready\n"

    def rates(self):
        return json.loads(self.program.stdout.readline())["rates"]


def check(folder):
    for server in SERVERS:
        until(lambda: fetch(ADDRESSES[server], "readyz"), f"{server} is ready")
    until(lambda: fetch(ADDRESSES["proxy"], "readyz"), "the proxy serves")
    time.sleep(2)  # until HAProxy has checked both
    for node in "cam0", "cam1":
        metrics = fetch(ADDRESSES[node], "metrics", 9110)
        assert "\nlightfield_cameras_working 8\n" in metrics, metrics
    before = Watch(VIEWERS, 6)
    assert [viewers(server) for server in SERVERS] == [VIEWERS / 2] * 2
    rates = before.rates()
    print(f"# pictures per second of {VIEWERS} viewers: {rates}")
    assert min(rates) > 1, rates
    check_keys(folder)
    check_resume()


def check_keys(folder):
    """Adds the new key, sends with it, and removes the old key."""
    def counts():
        return {name: sum(metric(server, name) for server in SERVERS) for name in ("pictures_total", "incomplete_pictures_total")}
    watch = Watch(VIEWERS, 12)
    before = counts()
    for keys in (OLD_KEY, NEW_KEY), (NEW_KEY, OLD_KEY), (NEW_KEY,):
        write_key(folder, *keys)
        time.sleep(3)
    made = {name: after - before[name] for name, after in counts().items()}
    rates = watch.rates()
    print(f"# the key was replaced: {made}; pictures per second: {rates}")
    assert min(rates) > 1, rates
    # On a busy machine, pictures are also incomplete because answers are late. A rejected packet is a fault of the keys.
    dropped = [metric(node, "dropped_packets_total", 9110) for node in ("cam0", "cam1")]
    assert dropped == [0, 0], dropped
    for server in SERVERS:
        log = subprocess.run(["podman", "logs", f"{server}-lf-serve"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert log.returncode == 0 and "are dropped" not in log.stdout, log.stdout
    # The old key is no longer valid.
    old = pathlib.Path(folder, "old")
    old.touch(0o600)
    old.write_text(OLD_KEY)
    run("gst-launch-1.0", "lfviewrequest", f"rig={folder}/config/rig.json", "num-buffers=1", "!", "rtplfpay", "!", "lfrtpseal",
        f"key-file={old}", "!", "udpsink", f"host={ADDRESSES['cam0']}", "port=6001",
        env={**os.environ, "GST_PLUGIN_PATH": f"{BUILD}/gst"})
    until(lambda: metric("cam0", "dropped_packets_total", 9110) > 0, "a packet with the old key is dropped", 20)


def check_resume():
    """Kills the pod of a page in Chromium."""
    page = subprocess.run([ROOT / "tests/web/browser.sh", BUILD, ROOT / "tests/web/demo.mjs"], capture_output=True, text=True,
                          timeout=300,
                          env={**os.environ, "LF_URL": f"http://{ADDRESSES['proxy']}:8080/",
                               "LF_KILL": "podman kill --signal KILL $1-lf-serve"})
    print("".join(line + "\n" for line in page.stdout.splitlines() if line.startswith("#") or "SKIP" in line), end="")
    assert page.returncode == 0 and "# SKIP" not in page.stdout, page.stdout + page.stderr


def main():
    if os.geteuid() != 0 or not all(map(shutil.which, ["podman", "mmdebstrap", "unshare"])):
        print("needs root, podman and mmdebstrap")
        sys.exit(77)  # skipped
    if HYBRID.is_mount():  # crun refuses to run while control groups of version 2 are mounted beside those of version 1
        os.execvp("unshare", ["unshare", "--mount", "sh", "-c", f'umount {HYBRID} && exec "$@"', "sh", sys.executable, *sys.argv])
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # removes the pods
    with tempfile.TemporaryDirectory() as folder:
        pathlib.Path(folder, "runtime").write_text(RUNTIME)
        pathlib.Path(folder, "runtime").chmod(0o755)
        pathlib.Path(folder, "containers.conf").write_text(
            f'[engine]\nruntime = "unlimited"\n[engine.runtimes]\nunlimited = ["{folder}/runtime"]\n')
        os.environ["CONTAINERS_CONF"] = f"{folder}/containers.conf"
        make_image(folder)
        volumes = write_configuration(folder)
        remove_pods()  # of a script that was killed
        try:
            play(folder, volumes)
            check(folder)
        finally:
            for name in ADDRESSES:
                logs = subprocess.run(["podman", "pod", "logs", "--tail", "3", name], capture_output=True, text=True)
                print(f"# {name}: " + " | ".join((logs.stdout + logs.stderr).splitlines()))
            remove_pods()
    print("ok")


main()
