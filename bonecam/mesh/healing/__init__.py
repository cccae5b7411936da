"""One closed, manifold, outward part of genus 0 from a damaged mesh."""
