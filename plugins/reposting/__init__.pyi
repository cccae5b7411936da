from .post import Posted as Posted
from .post import post as post
