"""Decode a recording of the three Hall voltages, row after row: where is the magnet, and which force acts?

`recording.csv` holds a press to 1.5 mm and then a shear to 1.2 mm of a plate that sticks, sampled every 50 ms. Tilt
and force of slow loading follow from the magnet's shift by the formulas of level finite, which know the rigid magnet;
`stream.step(field, time)` adds what the silicone relaxes, as
`magtip decode paper --file recording.csv --level finite` does.
"""

from __future__ import annotations

import csv
from pathlib import Path

from analytic.decode import decoder, field_of
from analytic.parts import of_design
from analytic.stream import Sample, Stream
from geometry.design import paper
from studies.sensing.decode_readings import of_level

RECORDING = Path(__file__).with_name("recording.csv")


def main() -> list[Sample]:
    sensor = paper()
    stream, samples = Stream(decoder(sensor, of_level(sensor, "finite"))), []

    print("time s   shift of the magnet mm     force on the tip N      status")
    with RECORDING.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            volts = [float(row[name]) for name in ("S1_V", "S2_V", "S3_V")]
            sample = stream.step(tuple(field_of(of_design(sensor), volts).tolist()))
            samples.append(sample)
            shift, force = (" ".join(f"{value:7.3f}" for value in part) for part in (sample.shift, sample.force))
            print(f"{row['time_s']:>6} {shift}  {force}   {sample.status}")
    return samples


if __name__ == "__main__":
    main()
