"""What several studies use: results, figures, times, processes, problems, searches and paths.

``results`` and ``versions`` load nothing but the standard library, so that a study of what enumsol loads can use them.
"""
