"""3-D Gaussian splats rendered, and what a loss on the picture says about them (Kerbl et al. 2023).

One interface (`rasterizer.py`), three implementations: `reference` (torch, double precision, automatic derivatives),
`compiled` (numba, for processors), `gpu` (gsplat, where CUDA is).
"""
