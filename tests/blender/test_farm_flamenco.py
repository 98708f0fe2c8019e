"""The job type of Flamenco, compiled in a JavaScript engine against the interface that Flamenco's
manual describes, and its tasks run in an order that their dependencies allow.
"""

from __future__ import annotations

import json

import pytest
from py_mini_racer import JSEvalException, MiniRacer

pytest.importorskip("bpy")
from farm_shot import Shot
from glint.operators import farm, farm_jobs
from glint.operators.tiles import Grid

# What a Manager gives to scripts, as its manual and its own tests have it: chunks are in order,
# three frames or more in a row are a range, and there may be spaces. Its engine (goja) was seen
# without String.replaceAll. Jobs keep copies of tasks, as
# Go's append of a struct does: what is added to a task later is lost.
MANAGER = """
delete String.prototype.replaceAll;
const author = {
    Task(name, type) {
        if (!name || !type) throw "author.Task(name, type): both are required";
        const task = { uuid: `${author.count++}`, name, type, commands: [], dependencies: [] };
        task.addCommand = command => { task.commands.push(command); };
        task.addDependency = other => { task.dependencies.push(other.uuid); };
        return task;
    },
    Command(name, parameters) { return { name, parameters }; },
    count: 0,
};
function frameChunker(range, size) {
    if (!range.trim()) throw "empty range";
    if (size < 1) throw "invalid chunk size";
    const found = new Set();
    for (const part of range.split("..").join("-").split(",")) {
        const [first, last] = part.split("-").map(Number);
        for (let frame = first; frame <= (last ?? first); frame++) found.add(frame);
    }
    const frames = [...found].sort((a, b) => a - b);
    const chunks = [];
    for (let k = 0; k < frames.length; k += size) chunks.push(merged(frames.slice(k, k + size)));
    return chunks;
}
function merged(frames) {
    const runs = [];
    for (const frame of frames) {
        const run = runs.at(-1);
        if (run && run.at(-1) == frame - 1) run.push(frame);
        else runs.push([frame]);
    }
    return runs.map(run => run.length > 2 ? `${run[0]}-${run.at(-1)}` : run.join(",")).join(",");
}
"""
SUBMIT = """
const job = { name: "shot", settings: %s, tasks: [] };
job.addTask = task => { job.tasks.push(JSON.parse(JSON.stringify(task))); };
compileJob(job);
JSON.stringify(job.tasks)
"""
TYPES = {"string": str, "int32": int, "float": float, "bool": bool}


def _compiled(script: str, **settings: object) -> tuple[dict, list[dict]]:
    """The job type, and the tasks of a job with its default settings and these."""
    engine = MiniRacer()
    engine.eval(MANAGER)
    engine.eval(script)
    kind = json.loads(engine.eval("JSON.stringify(JOB_TYPE)"))
    chosen = {one["key"]: one["default"] for one in kind["settings"] if "default" in one}
    return kind, json.loads(engine.eval(SUBMIT % json.dumps(chosen | settings)))


def test_settings_are_as_flamenco_asks(tmp_path):
    """Types are those that it has, and defaults are of them."""
    script = farm_jobs.flamenco_job_type("1-8:7, 3", 2, tmp_path / 'o"ut', Grid(3, 2))
    kind, _ = _compiled(script, blendfile="/shot.blend")
    assert kind["label"]
    known = {"key", "type", "subtype", "required", "default", "description", "visible", "propargs"}
    for setting in kind["settings"]:
        assert set(setting) <= known and setting["type"] in TYPES
        if "default" in setting:
            assert type(setting["default"]) is TYPES[setting["type"]]
    defaults = {one["key"]: one.get("default") for one in kind["settings"]}
    assert defaults == {
        "frames": "1,3,8",
        "chunk_size": 2,
        "columns": 3,
        "rows": 2,
        "out": str(tmp_path / 'o"ut'),
        "scripts": False,
        "blendfile": None,
    }


def test_whole_frames(tmp_path):
    _, tasks = _compiled(farm_jobs.flamenco_job_type("1-5", 2, tmp_path), blendfile="/a b.blend")
    assert [task["name"] for task in tasks] == ["frames 1,2", "frames 3,4", "frames 5", "check"]
    assert {task["type"] for task in tasks} == {"blender"}
    (command,) = tasks[0]["commands"]
    assert command["name"] == "exec" and command["parameters"]["exe"] == "{blender}"
    assert command["parameters"]["args"] == [
        *("-b", "--command", "glint", "frames", "/a b.blend", "1,2", "--out", str(tmp_path))
    ]
    assert tasks[-1]["dependencies"] == [task["uuid"] for task in tasks[:-1]]
    _, tasks = _compiled(farm_jobs.flamenco_job_type("1-5", 4, tmp_path), blendfile="/a b.blend")
    assert [task["name"] for task in tasks] == ["frames 1-4", "frames 5", "check"]


def test_all_commands_run_scripts_or_none(tmp_path):
    script = farm_jobs.flamenco_job_type("1-5", 2, tmp_path, Grid(2, 1), scripts=True)
    _, tasks = _compiled(script, blendfile="/a.blend")
    given = [task["commands"][0]["parameters"]["args"].count("--scripts") for task in tasks]
    assert given == [1] * len(tasks)


def test_blenders_way_to_write_ranges(tmp_path):
    script = farm_jobs.flamenco_job_type("1", 2, tmp_path)
    _, tasks = _compiled(script, blendfile="/a.blend", frames="1..3,7")
    assert tasks[-1]["commands"][0]["parameters"]["args"][5] == "1-3,7"
    # what a Manager takes as well
    _, tasks = _compiled(script, blendfile="/a.blend", frames=" 1  .. 10,\t20..25\n,40, 3..8   ")
    assert tasks[-1]["commands"][0]["parameters"]["args"][5] == "1-10,20-25,40,3-8"
    chunks = [task["commands"][0]["parameters"]["args"][5] for task in tasks[:-1]]
    assert chunks[:2] == ["1,2", "3,4"] and chunks[5:] == ["20,21", "22,23", "24,25", "40"]
    numbers = [number for chunk in chunks for number in farm.frame_numbers(chunk)]
    assert numbers == farm.frame_numbers(tasks[-1]["commands"][0]["parameters"]["args"][5])


def test_no_frames_are_no_job(tmp_path):
    script = farm_jobs.flamenco_job_type("1", 2, tmp_path)
    with pytest.raises(JSEvalException):
        _compiled(script, blendfile="/a.blend", frames=None)


@pytest.mark.slow
def test_the_tasks_draw_merge_and_check(tmp_path):
    """Three frames of two tiles, in the worst order that the dependencies allow: the last task that
    may run is the next.
    """
    shot = Shot(tmp_path)
    shot.make()
    options = ["--frames", "1-3", "--per-task", "2", "--tiles", "1x2", "--out", str(shot.out)]
    blend = str(tmp_path / "shot.blend")
    made = shot.glint("job", blend, "--engine", "flamenco", *options)
    assert made.returncode == 0 and "beside flamenco-manager" in made.output, made.output
    script = (tmp_path / "shot.flamenco.js").read_text()
    _, tasks = _compiled(script, blendfile=blend)
    assert len(tasks) == 2 * (2 + 1) + 1
    done: list[str] = []
    said = ""
    while tasks:
        ready = [task for task in tasks if set(task["dependencies"]) <= set(done)]
        tasks.remove(ready[-1])
        for command in ready[-1]["commands"]:
            run = shot.blender.start([str(shot.program), *command["parameters"]["args"]])
            assert run.returncode == 0, (ready[-1]["name"], run.output)
            said += run.output
        done.append(ready[-1]["uuid"])
    assert said.count(": merged (was missing)") == 3 and "3 of 3 frames verified" in said
    assert shot.names == ["shot_0001.exr", "shot_0002.exr", "shot_0003.exr"]
