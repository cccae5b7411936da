from . import filters as filters
from . import levels as levels
from . import mesh as mesh
from . import nc as nc
from . import orientation as orientation
from . import setup as setup
from . import surface as surface
from . import toolpath as toolpath
from . import verify as verify
from .batch import convert_many as convert_many
from .errors import BonecamError as BonecamError
from .filters.meshset import MeshSet as MeshSet
from .job import Job as Job
from .job import read_job as read_job
from .job import write_job as write_job
from .mesh.part import Part as Part
from .mesh.triangle_mesh import TriangleMesh as TriangleMesh
from .outputs.batch_table import Outcome as Outcome
from .outputs.kept_folder import keep_levels as keep_levels
from .outputs.kept_view import view as view
from .outputs.result import Morphed as Morphed
from .outputs.result import Result as Result
from .pipeline import convert as convert
from .pipeline import morph_levels as morph_levels
from .simulation import simulate as simulate

__version__: str
