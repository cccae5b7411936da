from .cluster import cluster_executor as cluster_executor
from .run import BatchPart as BatchPart
from .run import Wanted as Wanted
from .run import batch_parts as batch_parts
from .run import convert_many as convert_many
