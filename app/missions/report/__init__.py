"""The report of a survey: what REST answers about a mission, in one document, as a web page and as a PDF.

``answers`` is what it is made of, ``texts`` its words in each language, ``contents`` what stands in it; ``page`` and
``print`` make files of a ``document``.
"""
