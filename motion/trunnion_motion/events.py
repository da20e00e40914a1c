"""Turn layers and settings into what happens between motions: heat, fan, layer marks."""

import numpy as np

from trunnion_core.arrays import IntArray
from trunnion_core.profile import MachineProfile
from trunnion_core.program import Event
from trunnion_core.settings import PrintSettings


def events_for(layer: IntArray, profile: MachineProfile, settings: PrintSettings) -> tuple[Event, ...]:
    """Events in order of execution for program rows whose layers are `layer` (n,), never falling.

    Before the first row the bed is heated and waited for, then the nozzle. Temperatures of the other layers are set
    where the first layer ends, the fan where the layers without it end.
    """
    if not len(layer):
        return ()
    nozzle, bed = settings.temperature, settings.bed_temperature
    first_nozzle = nozzle if settings.first_layer_temperature is None else settings.first_layer_temperature
    first_bed = bed if settings.first_layer_bed_temperature is None else settings.first_layer_bed_temperature
    has_bed = profile.heaters.bed is not None
    events = []
    if has_bed and first_bed > 0:
        events += [Event(0, "bed_temperature", first_bed), Event(0, "wait_bed", first_bed)]
    if first_nozzle > 0:
        events += [Event(0, "nozzle_temperature", first_nozzle), Event(0, "wait_nozzle", first_nozzle)]
    numbers, rows = np.unique(layer, return_index=True)
    fan_from = int(np.searchsorted(numbers, settings.disable_fan_first_layers))
    for place, (number, row) in enumerate(zip(numbers.tolist(), rows.tolist(), strict=True)):
        if place == 1 and nozzle != first_nozzle:
            events.append(Event(row, "nozzle_temperature", nozzle))
        if place == 1 and has_bed and bed != first_bed:
            events.append(Event(row, "bed_temperature", bed))
        if place == fan_from and settings.fan_speed > 0:
            events.append(Event(row, "fan", settings.fan_speed / 100))
        events.append(Event(row, "layer", number))
    return tuple(events)
