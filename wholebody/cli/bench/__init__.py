"""The command group `wholebody bench`: the words and options of its commands."""

from __future__ import annotations

from wholebody.cli.arguments import JOBS
from wholebody.cli.bench.command import CLIPS, listed, measuring, out, quick, seed
from wholebody.cli.command import Group, command, count, later, path, real, text, whole

group = Group(
    "bench",
    "measure steps, solves and problem sets, beside other tools where installed",
    """\
Measure what the package does, and write the numbers as CSV, the charts as SVG and PNG, and tables to read. Times depend
on the machine and on what else runs on it: compare ratios of one run.""",
    (
        command(
            "compare",
            "every method on every problem set",
            """\
Solve problems with known answers by every method at many budgets, and chart speed against accuracy. Writes a report
(report.html) that says which method to choose when, charts as SVG and PNG, and every solve as CSV. Call an
interrupted run again with the same settings and folder to continue it; a finished one writes its report again.
--again compares times in units of a reference kernel; the exit code is 1 if the solved problems differ. --jobs solves
cases in parallel by joblib, --cluster on a dask cluster.""",
            quick("20 problems a set, within three minutes on two cores"),
            path("--task", "TASK.toml", "compare on the problem of a task file, in place of the sets"),
            listed("--sets", "problem sets (default: all)"),
            listed(
                "--methods",
                "methods, such as qp, newton or ccd; all for every method (default: one of each algorithm, from "
                "one start and from several; with --quick with their usual starts)",
            ),
            count("--cases", None, "problems of each set (default: 200)"),
            real("--minutes", "N", "of solving in all (default: 25; with --quick 2)"),
            seed("of all problems"),
            *JOBS,
            path("--again", "LOCK.json", "repeat the comparison that left this file"),
            out("out/compare"),
        )(later("bench.comparing.compare")),
        command(
            "export",
            "the problem sets as files for any program",
            """\
Write the problems of the sets as files that any program reads: JSON with a schema, the body as URDF, meshes as OBJ, two
seeds each (near: the start; far: random), what must hold, and apart from them a posture that solves each, with measures
of how hard it is. The same sets, number and seed give the same files. They are in the public domain (CC0).""",
            path("folder", "DIR", "a folder that does not exist yet"),
            listed("--sets", "problem sets (default: all)"),
            count("--per-set", None, "problems of each set (default: 200)"),
            seed("of all problems"),
        )(later("bench.published.write_problems")),
        command(
            "answer",
            "answer exported problems by a method",
            """\
Solve the problems that `wholebody bench export` wrote by one method, from both seeds, and write the file of answers
that `wholebody bench judge` scores. What the method refuses is written with its reason.""",
            path("folder", "DIR", "folder of the exported problems"),
            text("--method", "NAME", "such as qp or my_module:MyMethod (default: qp)", default="qp"),
            listed("--sets", "problem sets (default: all of the export)"),
            path("--out", "PATH", "where the answers are written (default: METHOD.answers.json)"),
        )(later("bench.published.answer")),
        command(
            "judge",
            "score anybody's answers to published problems",
            """\
Score a file of answers to problems that `wholebody bench export` wrote, whatever program wrote the answers: goals,
overlap of all pairs, clearances, joint limits, what is held, and effort above the best known. The scenes are rebuilt
from the files by Pinocchio and coal alone. Prints a table, and writes every figure as JSON. Answers that are malformed
are refused with one sentence that names the entry. Of a folder with a file of answers for each method it makes a
leaderboard: a page with tables, charts and sentences that say what to choose when, and what cannot be told apart.""",
            path("answers", "ANSWERS", "a file, as answers.schema.json says, or a folder of them"),
            path("--problems", "DIR", "folder of the exported problems", required=True),
            path(
                "--out",
                "PATH",
                "where the verdict is written (default: ANSWERS.verdict.json; of a folder out/leaderboard)",
            ),
        )(later("bench.published.judge_answers")),
        measuring(
            "stability",
            "hard cases by methods: where each fails, and how",
            "Ask every method every hard case, in processes that may crash, and judge the answers: solved, an "
            "honest best effort, a clear refusal, or WRONG.",
            listed(
                "--methods",
                "methods, such as qp, newton or ccd; all for every one (default: one of each algorithm)",
            ),
            listed("--cases", "cases (default: all; with --quick a few)"),
            count("--jobs", 1, "processes at a time"),
        )(later("bench.hard_cases.stability")),
        measuring(
            "step",
            "one step of tracking by every tool",
            "The same 200-step reach by every installed tool, interleaved, judged independently. With --figure these "
            "figures replace the standing human; tools that do not take one say why.",
            listed("--figure", "URDF or MJCF files, or names of figures", "FILE"),
            count("--repeats", 5, "timed runs of every tool"),
            whole("--steps", "N", "of each run (default: 200)", default=200),
            listed("--tools", "only these (default: all that are installed)"),
        )(later("bench.measurements.measure_step")),
        measuring(
            "scaling",
            "time of a step and a solve against joints, pieces and things, with exponents",
            "Chains of 5 to 200 joints (500 bodies without a model of joints), 1 to 32 pieces a segment, 10 to "
            "5000 things around, and the exponents with which times grow.",
            count("--repeats", 5, "timed solves each"),
            listed("--methods", "methods (default: qp newton ccd placo)"),
        )(later("bench.measurements.measure_scaling")),
        measuring(
            "motion",
            "clips freed of collisions by each method, with each piece of equipment",
            "Free clips of collisions by each method, with each piece of equipment, as `wholebody clip avoid` does, "
            "and sum up deviation, jerk, sliding and time: clips that need no recordings, and the recordings of a "
            "folder. An interrupted run continues from its folder.",
            *CLIPS,
            listed("--equipment", "what is worn (default: all)"),
            listed("--methods", "methods (default: all)"),
            count("--jobs", 1, "cases at a time"),
        )(later("bench.measurements.measure_motion")),
        measuring(
            "clips",
            "recordings retargeted, beside mink frame by frame as General Motion Retargeting does",
            "Follow every recording (BVH) below a folder by wholebody and by mink with the stages, weights and damping "
            "of General Motion Retargeting, without contact, and judge both alike: errors of bones, depth, slide, jerk "
            "and frames a second.",
            path("folder", "FOLDER", "of recordings"),
            count("--frames", 60, "frames of each recording that are followed"),
            listed("--figure", "figures that follow; URDF files go about freely (default: human)", "FIGURE"),
        )(later("bench.measurements.measure_clips")),
        measuring(
            "world",
            "things that move by themselves, beside MuJoCo and Rapier",
            "Drop, slide and stack the same things in wholebody, MuJoCo and Rapier.",
            listed("--only", "names of drops (default: all)", "DROP"),
            listed("--engines", "wholebody, mujoco, rapier (default: installed)"),
        )(later("bench.measurements.measure_world")),
        measuring(
            "files",
            "what is read of the files of a folder",
            "Read every robot, mesh and recording below a folder; recordings are retargeted to the person. The table "
            "has what was read, the sentence by which the rest is refused, the errors of bones, and the processor's "
            "time.",
            path("folder", "FOLDER", "of the files"),
            count("--frames", 60, "frames of each recording that are retargeted"),
        )(later("bench.measurements.measure_files")),
        command(
            "attack",
            "random hard cases of every kind, judged",
            """\
Attack the package with random hard cases: solves that begin inside things, with goals that contradict or are out of
reach; streams; sweeps; contacts beside points at the place found; mutated files. Answers are judged by coal over all
pairs and by Pinocchio alone. Every failure is written as a script that repeats it. Case K of a seed is
always the same. The exit code is 1 where something was wrong: a false claim, an error other than one sentence, a crash,
or no end within a minute. What ended before Ctrl-C is written.""",
            real("--seconds", "S", "how long (default: 60)", default=60.0),
            seed("of all cases"),
            count("--first", 0, "number of the first case", least=0),
            count("--cases", None, "end after as many cases, if the time suffices"),
            listed("--kinds", "of cases, such as solve, stream, own-term, sleeper, file (default: all)", "KIND"),
            count("--jobs", 1, "processes at a time"),
            out("out/attack"),
        )(later("bench.hard_cases.attack")),
    ),
    title="what to measure",
)
