from .clamping import Clamping as Clamping
from .clamping import clamping_of as clamping_of
from .post import Post as Post
from .post import post_below as post_below
