// SPDX-License-Identifier: GPL-3.0-or-later
// A job type of Flamenco: frames that Glint draws, each whole or not at all. `blender --command
// glint job --engine flamenco` writes it with GIVEN, what its command line said, before it.

const JOB_TYPE = {
    label: "Glint Render",
    description: "Draw frames with Glint, whole or in tiles, and look at all of them at the end",
    settings: [
        { key: "frames", type: "string", required: true, default: GIVEN.frames,
          description: "Frames to draw, as in 1-240 or 1,5,9" },
        { key: "chunk_size", type: "int32", default: GIVEN.chunk_size, propargs: { min: 1 },
          description: "Frames of a task", visible: "submission" },
        { key: "columns", type: "int32", default: GIVEN.columns, propargs: { min: 1, max: 64 },
          description: "Tiles of a frame, beside each other", visible: "submission" },
        { key: "rows", type: "int32", default: GIVEN.rows, propargs: { min: 1, max: 64 },
          description: "Tiles of a frame, above each other", visible: "submission" },
        { key: "out", type: "string", subtype: "dir_path", required: true, default: GIVEN.out,
          description: "Folder for the pictures, which every worker sees" },
        { key: "scripts", type: "bool", default: GIVEN.scripts,
          description: "Run scripts and drivers of the .blend file, which you trust" },
        { key: "blendfile", type: "string", required: true, visible: "web",
          description: "Path of the .blend file" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const tiles = settings.columns * settings.rows;
    const done = [];
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        if (tiles == 1) {
            done.push(add(job, `frames ${chunk}`, ["frames", settings.blendfile, chunk]));
            continue;
        }
        const grid = ["--tiles", `${settings.columns}x${settings.rows}`];
        const parts = [];
        for (let tile = 1; tile <= tiles; tile++) {
            const words = ["frames", settings.blendfile, chunk, ...grid, "--tile", `${tile}`];
            parts.push(add(job, `tile ${tile} of frames ${chunk}`, words));
        }
        const merge = ["merge", settings.blendfile, chunk, ...grid];
        done.push(add(job, `merge frames ${chunk}`, merge, parts));
    }
    const all = settings.frames.replace(/\.\./g, "-").replace(/\s/g, "");
    add(job, "check", ["frames", settings.blendfile, all, "--check"], done);
}

// A task of one command; it is whole before the job gets it, which keeps a copy.
function add(job, name, words, dependencies = []) {
    const task = author.Task(name, "blender");
    task.addCommand(author.Command("exec", {
        exe: "{blender}",
        args: ["-b", "--command", "glint", ...words, "--out", job.settings.out,
               ...(job.settings.scripts ? ["--scripts"] : [])],
    }));
    for (const other of dependencies) {
        task.addDependency(other);
    }
    job.addTask(task);
    return task;
}
