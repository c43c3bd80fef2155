"""Run by the Python that has KiCad's module pcbnew: check a board, and plot it, as `board_check` asks for.

Arguments: the board's file, and the folder for Gerber and drill files and the reports. Prints one object of JSON.
"""

import json
import sys
from pathlib import Path
from typing import Any


def main(file: str, folder: str) -> None:
    import pcbnew

    board = pcbnew.LoadBoard(file)
    found = {"version": pcbnew.Version(), "loaded": report(board, Path(folder) / "loaded.txt")}
    plot(board, folder)
    found["ground_mm2"] = [zone.GetFilledArea() / 1e12 for zone in board.Zones()]
    pcbnew.ZONE_FILLER(board).Fill(board.Zones())
    found["refilled_mm2"] = [zone.GetFilledArea() / 1e12 for zone in board.Zones()]
    found["refilled"] = report(board, Path(folder) / "refilled.txt")
    origin = board.GetDesignSettings().GetAuxOrigin()
    found["places"] = {
        part.GetReference(): [
            pcbnew.ToMM(part.GetPosition().x - origin.x),
            -pcbnew.ToMM(part.GetPosition().y - origin.y),
            part.GetOrientationDegrees(),
        ]
        for part in board.GetFootprints()
    }
    print(json.dumps(found))


def report(board: Any, file: Path) -> list[str]:
    """Return what KiCad's check finds: violations of rules with errors and warnings, unconnected pads."""
    import pcbnew

    pcbnew.WriteDRCReport(board, str(file), pcbnew.EDA_UNITS_MILLIMETRES, True)
    return [line.strip() for line in file.read_text("utf-8").splitlines() if line.startswith("[")]


def plot(board: Any, folder: str) -> None:
    """Write Gerber and Excellon files, with the origin of the board's drill and place files."""
    import pcbnew

    plotter = pcbnew.PLOT_CONTROLLER(board)
    options = plotter.GetPlotOptions()
    options.SetOutputDirectory(folder)
    options.SetUseAuxOrigin(True)
    options.SetUseGerberProtelExtensions(False)
    options.SetSubtractMaskFromSilk(False)
    options.SetPlotFrameRef(False)
    options.SetDrillMarksType(0)
    for name in ("F.Cu", "B.Cu", "F.Mask", "B.Mask", "F.Paste", "B.Paste", "F.SilkS", "Edge.Cuts"):
        plotter.SetLayer(board.GetLayerID(name))
        plotter.OpenPlotfile(name, pcbnew.PLOT_FORMAT_GERBER, "")
        plotter.PlotLayer()
    plotter.ClosePlot()
    drills = pcbnew.EXCELLON_WRITER(board)
    drills.SetOptions(False, False, board.GetDesignSettings().GetAuxOrigin(), False)
    drills.SetFormat(True)
    drills.CreateDrillandMapFilesSet(folder, True, False)


if __name__ == "__main__":
    main(*sys.argv[1:])
