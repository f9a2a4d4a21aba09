"""The command line: help, exit codes, names that are nearly right."""

import subprocess

import pytest
from pour.served import command

from pipeline.errors import PipelineError
from pipeline.pour.__main__ import SUBCOMMANDS, main


def test_objects_are_those_of_the_configuration_and_of_data_raw(project):
    assert project.objects() == ["jug", "mug", "tall_cup"]
    assert project.source() == "mug"


def test_a_misspelt_object_is_refused_with_the_nearest_name(project):
    with pytest.raises(PipelineError, match=r"did you mean 'tall_cup'\?"):
        project.check("tal_cup")


def test_what_is_not_made_yet_says_how_it_is_made(project):
    with pytest.raises(PipelineError, match=r"run: snakemake -c2 data/processed/fuse/jug/mesh\.ply"):
        project.made("fuse/jug/mesh.ply")


def test_help_names_every_subcommand(capsys):
    with pytest.raises(SystemExit) as exit:
        main(["--help"])
    assert exit.value.code == 0
    said = capsys.readouterr().out
    for module in SUBCOMMANDS:
        name = module.__name__.rpartition(".")[2]
        assert f"    {name} " in said
        with pytest.raises(SystemExit):
            main([name, "--help"])
        assert "exit codes" in capsys.readouterr().out


def test_exit_codes_and_where_words_go(project):
    def call(*arguments):
        return subprocess.run(command(project, *arguments), capture_output=True, text=True)

    wrong_name = call("view", "tal_cup", "--json")
    assert (wrong_name.returncode, wrong_name.stdout) == (1, "")
    assert wrong_name.stderr.startswith("error: tal_cup")
    assert wrong_name.stderr.count("\n") == 1
    assert call("vieww", "mug").returncode == 2
