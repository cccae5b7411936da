from .cluster import cluster_executor as cluster_executor
from .one_part import Wanted as Wanted
from .parts import BatchPart as BatchPart
from .parts import batch_parts as batch_parts
from .run import convert_many as convert_many
