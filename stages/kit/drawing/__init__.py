"""Colours, plots and the layout of trees and plans, as steps and the viewer draw them."""
