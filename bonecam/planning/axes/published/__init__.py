"""The choice of tool axes as published (Xu et al. 2013, sections 3 to 5), for comparison."""
