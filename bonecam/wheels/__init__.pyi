from .blading import blades as blades
from .results import Bladed as Bladed
from .tables import read_flow_path as read_flow_path
from .tables import read_sections as read_sections
from .wheel import Impeller as Impeller
from .wheel import impeller as impeller
