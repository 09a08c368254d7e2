"""An identified vehicle in the forms that other tools know; what a form cannot express is named, not dropped."""

from rotorid.vehicle.exports.all_forms import export_vehicle
from rotorid.vehicle.exports.forms import Exported

__all__ = ["Exported", "export_vehicle"]
